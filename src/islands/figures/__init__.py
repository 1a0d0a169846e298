"""Figures of results, one file per family: functions that return a matplotlib figure and show nothing."""
