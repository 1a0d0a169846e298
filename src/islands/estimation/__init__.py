"""Parameters from data: least squares, constrained least squares, forward orthogonal regression."""
