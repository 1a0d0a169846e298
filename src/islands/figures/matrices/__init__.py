"""Matrices of causes as figures."""
