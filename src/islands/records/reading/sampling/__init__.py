"""Sampling of a record: its time column, gaps, and a uniform grid."""
