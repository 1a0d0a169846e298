"""Constraints that a user can state: their parts, their text and their verification.

Read `parts` first.
"""
