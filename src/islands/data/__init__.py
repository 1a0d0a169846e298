"""Records of measured or simulated data and their split into estimation and validation data.

Read `dataset` first.
"""
