"""Runs of jobs in this process, with an engine that needs no cluster."""

from collections.abc import Callable
from typing import Any

from islands.evolution.engine import SerialEngine
from islands_service.coordinator.job_notes import JobNotes
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import Lease


def make_run(
    lease: Lease,
    store: Any,
    blobs: Any,
    check: Callable[[], None] = lambda: None,
    checkpoint_every: float = 600.0,
) -> JobRun:
    """Return the run of a job with a serial engine."""
    return JobRun(lease, store, blobs, SerialEngine(), check, checkpoint_every, JobNotes(lease, store))
