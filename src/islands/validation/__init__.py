"""What a model is worth: error metrics, residual tests, physics checks."""
