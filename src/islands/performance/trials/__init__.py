"""Blind trials: an effect is hidden in a record by code of its own, and the analysis has to find it."""
