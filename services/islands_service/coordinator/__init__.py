"""The coordinator: leases jobs, drives their islands, checkpoints, and writes down what they brought."""
