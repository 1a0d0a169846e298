"""Runs of jobs in this process, with an engine that needs no cluster."""

from collections.abc import Callable
from typing import Any

from islands.evolution.engine import SerialEngine
from islands_service.coordinator.heartbeat import CoordinatorStopping
from islands_service.coordinator.job_run import JobNotes, JobRun
from islands_service.domain.job import Job, Lease


class Interruption:
    """A check that raises when the progress of a job has reached a generation."""

    def __init__(self, store: Any, job: Job, at: int, reason: type[Exception] = CoordinatorStopping) -> None:
        self._store, self._owner, self._job = store, job.owner, job.id
        self._at, self._reason = at, reason

    def __call__(self) -> None:
        progress = self._store.jobs.get(self._owner, self._job).progress
        if progress is not None and progress.get("generation", -1) >= self._at:
            raise self._reason("enough")


def make_run(
    lease: Lease,
    store: Any,
    blobs: Any,
    check: Callable[[], None] = lambda: None,
    checkpoint_every: float = 600.0,
    is_search_stopped: Callable[[], bool] = lambda: False,
) -> JobRun:
    """Return the run of a job with a serial engine."""
    notes = JobNotes(lease, store)
    return JobRun(
        *(lease, store, blobs, SerialEngine(), check, checkpoint_every, notes, lambda: None),
        is_search_stopped=is_search_stopped,
    )
