"""Expressions over signals and named values: tree, functions, parser, printers, derivative.

Read `tree` first, then `primitives`.
"""
