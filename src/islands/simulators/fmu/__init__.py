"""Functional Mock-up Units (FMUs) of FMI 2.0 and 3.0. Read `fmi_description` first, then `model`."""
