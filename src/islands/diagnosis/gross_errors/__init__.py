"""Gross errors of a record, which are looked for before effects are."""
