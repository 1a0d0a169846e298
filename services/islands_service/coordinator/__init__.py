"""Coordinator process: leases jobs and runs them on Ray. Read `main_loop` first."""
