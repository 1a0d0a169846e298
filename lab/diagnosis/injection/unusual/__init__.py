"""Unusual causes: discrepancies that are mostly in no catalogue, each simulated by its own equations."""
