"""Measurements of the project: speed (`benchmark`) and detection rates (`trials`)."""
