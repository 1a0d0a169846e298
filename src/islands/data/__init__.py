"""Records of measured or simulated data."""
