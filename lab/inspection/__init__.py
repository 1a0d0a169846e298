"""Inspection of records: how often roles, dead times and gross errors are right."""
