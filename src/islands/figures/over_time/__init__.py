"""Figures of quantities over time."""
