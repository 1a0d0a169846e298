"""Columns of a file: time stamps, and which columns are inputs and output."""
