"""Estimation of a simulator's parameters from data. Read `levenberg_marquardt` first."""
