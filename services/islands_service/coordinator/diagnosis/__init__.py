"""Discrepancy jobs: diagnosis of a simulation, its progress and its checkpoints."""
