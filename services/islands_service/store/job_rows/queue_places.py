"""Places of queued jobs: their positions, and the quotas that they wait for."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, bindparam, func, select

from islands_service.domain.job import Job, JobState
from islands_service.store.job_rows.fair_queue import estimate_positions, has_room
from islands_service.store.job_rows.submission_checks import select_quota
from islands_service.store.tables import jobs, owners

# Built once, since building a statement takes as long as executing it.
_USAGE = (
    select(
        func.count().label("running"),
        func.coalesce(func.sum(jobs.c.islands), 0).label("islands"),
        select_quota(owners.c.max_running, "most_running").label("most_running"),
        select_quota(owners.c.max_islands, "most_islands").label("most_islands"),
    )
    .select_from(jobs)
    .where(jobs.c.owner == bindparam("owner"), jobs.c.state == JobState.RUNNING)
)
_ISLANDS = select(jobs.c.islands).where(jobs.c.id == bindparam("id"))


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """Place of a queued job.

    Attributes
    ----------
    position : int
        See `estimate_positions`.
    note : str
        The quota that the job waits for; empty if it waits for none.
    """

    position: int
    note: str = ""


def find_places(
    connection: Connection, found: Iterable[Job], most_running: int | None, most_islands: int | None
) -> dict[str, QueuePlace]:
    """Return the places of the queued ones of some jobs.

    Parameters
    ----------
    most_running, most_islands : int, optional
        Quotas of running jobs, and of their islands, of an owner for which none were set; unlimited by
        default.
    """
    listed = list(found)
    positions = estimate_positions(connection, listed)
    quotas = {"most_running": most_running, "most_islands": most_islands}
    queued = [job for job in listed if job.id in positions]
    usage = {
        owner: connection.execute(_USAGE, {"owner": owner, **quotas}).one()
        for owner in {job.owner for job in queued}
    }
    return {
        job.id: QueuePlace(positions[job.id], _explain_wait(connection, job, usage[job.owner]))
        for job in queued
    }


def _explain_wait(connection: Connection, job: Job, usage: Row[Any]) -> str:
    if usage.most_running is not None and usage.running >= usage.most_running:
        return f"waits for your quota of running jobs: {usage.running} of {usage.most_running} are running"
    if usage.most_islands is None:
        return ""
    own = connection.execute(_ISLANDS, {"id": job.id}).scalar_one()
    if has_room(usage, own):
        return ""
    return (
        f"waits for your quota of running islands: {usage.islands} of {usage.most_islands} are running, and "
        f"this job has {own}"
    )
