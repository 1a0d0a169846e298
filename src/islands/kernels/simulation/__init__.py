"""Simulation of models in rows of lanes: one equation, or several that read each other."""
