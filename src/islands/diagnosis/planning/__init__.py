"""Planning of experiments: which causes an input and its channels could tell apart, before any data."""
