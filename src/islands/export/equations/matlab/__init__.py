"""Programs of extended simulations in MATLAB, which also run in Octave."""
