"""A process of the service: its settings and its metrics."""
