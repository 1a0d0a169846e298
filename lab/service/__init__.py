"""Measurements of the service: load, recovery, costs, capacity, and the page."""
