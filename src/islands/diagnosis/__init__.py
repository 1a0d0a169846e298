"""Diagnosis of a simulation: which effects it lacks, and how much they improve it. Read `procedure` first."""
