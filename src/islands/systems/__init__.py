"""Simulated physical systems and excitation signals, which provide records with known parameters.

Read `catalogue` first.
"""
