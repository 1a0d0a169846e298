"""Rows of jobs, within a transaction: updates with their events, claims, checks of submissions."""
