"""Statistics of the jobs of all owners, for metrics."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, func, select

from islands_service.domain.job import ACTIVE, JobState
from islands_service.store.backends.dialect import now
from islands_service.store.job_rows.job_events import read_document
from islands_service.store.tables import jobs


@dataclass(frozen=True, slots=True)
class QueueStatistics:
    """Statistics of the jobs of all owners.

    Attributes
    ----------
    counts : mapping
        Number of jobs by state.
    oldest : float
        Seconds that the oldest queued job has waited since it was last queued.
    running : mapping
        Progress of the jobs with a valid lease, by job.
    active : mapping
        Number of queued and running jobs by owner and state.
    """

    counts: Mapping[JobState, int]
    oldest: float
    running: Mapping[str, Mapping[str, Any]]
    active: Mapping[tuple[str, JobState], int]

    @property
    def leases(self) -> int:
        """Number of jobs with a valid lease."""
        return len(self.running)


def read_queue_statistics(connection: Connection) -> QueueStatistics:
    """Return statistics of the jobs of all owners."""
    counted = select(jobs.c.state, func.count()).group_by(jobs.c.state)
    active = (
        select(jobs.c.owner, jobs.c.state, func.count())
        .where(jobs.c.state.in_(ACTIVE))
        .group_by(jobs.c.owner, jobs.c.state)
    )
    oldest = select(func.coalesce(now() - func.min(jobs.c.updated), 0.0)).where(
        jobs.c.state == JobState.QUEUED
    )
    running = select(jobs.c.id, jobs.c.progress).where(
        jobs.c.state == JobState.RUNNING, jobs.c.lease_until > now()
    )
    counts = {row[0]: row[1] for row in connection.execute(counted)}
    return QueueStatistics(
        {state: counts.get(state, 0) for state in JobState},
        connection.execute(oldest).scalar_one(),
        {row.id: read_document(row.progress) or {} for row in connection.execute(running)},
        {(row[0], JobState(row[1])): row[2] for row in connection.execute(active)},
    )
