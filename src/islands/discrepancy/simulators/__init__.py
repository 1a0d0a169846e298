"""Simulators that can be diagnosed: physical systems, models, Python functions, recorded outputs.

Read `second_order` first, then `extended`, which adds effects to a simulator.
"""
