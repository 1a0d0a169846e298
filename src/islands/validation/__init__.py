"""Validation of models: error metrics, residual tests and physics checks.

Read `assessment` first.
"""
