"""Which effects explain a residual: screening, stepwise search, verdict. Read `strategies` first."""
