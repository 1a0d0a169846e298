"""Specifications of simulators: table, factory, extended simulations as JSON. Read `table` first."""
