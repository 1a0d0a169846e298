"""Response of the output to an input: its first lag and its impulse response."""
