"""Measurements of the project: `speed`, and `detection` of injected faults by blind trials."""
