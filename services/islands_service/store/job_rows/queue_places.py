"""Places of queued jobs: their positions, the quotas that they wait for, and the time until they start."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, bindparam, func, select

from islands_service.domain.job import MONITORING, WAITING_PHASE, Job, JobState, find_seconds_left
from islands_service.store.backends.dialect import now
from islands_service.store.job_rows.fair_queue import estimate_positions, has_room
from islands_service.store.job_rows.job_events import read_document
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
_RUNNING = select(jobs.c.progress, jobs.c.updated, now().label("now")).where(jobs.c.state == JobState.RUNNING)


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """Place of a queued job.

    Attributes
    ----------
    position : int
        See `estimate_positions`.
    note : str
        The quota that the job waits for; empty if it waits for none.
    seconds_to_start : float or None
        Estimated seconds until it starts; None if they are unknown. See `_estimate_start`.
    """

    position: int
    note: str = ""
    seconds_to_start: float | None = None


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
    left = _list_times_left(connection) if queued else []
    places = {}
    for job in queued:
        position, note = positions[job.id], _explain_wait(connection, job, usage[job.owner])
        places[job.id] = QueuePlace(position, note, _estimate_start(job, position, note, left))
    return places


def _list_times_left(connection: Connection) -> list[float]:
    """Return the known times left of running jobs in seconds, the shortest first."""
    found = (
        find_seconds_left(read_document(row.progress) or {}, row.updated, row.now)
        for row in connection.execute(_RUNNING)
    )
    return sorted(seconds for seconds in found if seconds is not None)


def _estimate_start(job: Job, position: int, note: str, left: Sequence[float]) -> float | None:
    """Return the seconds until a job starts: those after which as many running jobs have ended.

    A job earlier in the queue whose run is shorter lets it start before. None is returned if jobs have to
    start and end before it, whose duration is unknown, or if it does not wait for the end of a running job:
    for a quota, for the time of its next attempt, or for earlier records of its monitor.
    """
    waits_otherwise = note or job.kind == MONITORING or (job.progress or {}).get("phase") == WAITING_PHASE
    return None if waits_otherwise or position > len(left) else left[position - 1]


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
