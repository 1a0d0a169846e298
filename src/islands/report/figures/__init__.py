"""Figures of results: functions that return a matplotlib figure. Read `registry` and `style` first."""
