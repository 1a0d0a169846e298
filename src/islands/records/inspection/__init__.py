"""Facts about a record before a model is sought: noise, dead time, excitation, rest, loops and drift.

Read `fact` first. Each other file measures one property of a `islands.records.dataset.Dataset`.
"""
