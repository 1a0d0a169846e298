"""Identification of several outputs of one system: one equation each, simulated together."""
