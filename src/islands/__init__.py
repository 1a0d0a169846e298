"""Finds the equation behind measured data."""
