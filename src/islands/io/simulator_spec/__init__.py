"""Specifications of simulators: schema, factory, extended simulations as JSON. Read `schema` first."""
