"""Published sets of measurements, and the errors of models on their tests. Read `definition` first.

No search knows any of them: a test scans the sources for their names.
"""
