"""Simulators that can be diagnosed: physical systems, models, Python functions, recorded outputs.

Read `interface` first, then `ode.simulator`, and `extended`, which adds effects to a simulator.
"""
