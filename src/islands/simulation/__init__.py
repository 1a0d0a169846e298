"""Simulation of models: one-step-ahead prediction, multiple shooting and free run.

Read `predictors` first.
"""
