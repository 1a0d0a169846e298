"""Blind fault-injection trials of the discrepancy analysis. Read `trial` first.

Code that is independent of the analysis injects faults into simulated records; the analysis has to name them.
"""
