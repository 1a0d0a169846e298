"""Estimation of parameters: least squares, constrained least squares, forward orthogonal regression.

Read `estimate` first.
"""
