"""Predictions of a model: one step ahead, multiple shooting, free run."""
