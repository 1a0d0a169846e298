"""Simulations that can be diagnosed: physical systems, identified models, a column of the record."""
