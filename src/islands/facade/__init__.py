"""Functions that a user calls: identify, fit, diagnose, explain a residual. Read `identify` first."""
