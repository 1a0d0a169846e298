"""Measurements of the project: speed (`benchmark`) and detection rates (`blind_trials`)."""
