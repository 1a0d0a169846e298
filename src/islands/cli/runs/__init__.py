"""Runs of the command line that are longer than the command that starts them."""
