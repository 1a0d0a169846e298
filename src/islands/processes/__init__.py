"""Processes: their threads and garbage collection, pools of them, signals that do not reach them."""
