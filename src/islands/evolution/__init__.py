"""Multi-gene genetic programming with forward orthogonal regression: islands that evolve NARX models."""
