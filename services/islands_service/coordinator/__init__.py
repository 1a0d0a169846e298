"""Coordinator process: leases jobs and runs them on Ray. Read `coordinator` first."""
