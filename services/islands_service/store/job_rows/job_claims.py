"""Claims of jobs: the order of the queue, and the end of a job without progress."""

import json
from typing import Any

from sqlalchemy import Connection, and_, func, or_, select, tuple_

from islands_service.domain.job import Job, JobState, Lease
from islands_service.store.backends.dialect import now
from islands_service.store.job_rows.job_events import append_event, job_from_row, read_document, update_job
from islands_service.store.tables import jobs

#: Attempts since the last checkpoint after which a job is given up.
ATTEMPTS = 5

#: Problem of a job that failed after `ATTEMPTS` attempts.
GAVE_UP = {
    "type": "no-progress",
    "title": "The job was given up",
    "detail": f"{ATTEMPTS} attempts ended without progress, most likely for lack of memory: "
    "use fewer islands, smaller populations or a shorter record, and resume or submit it again",
}


def claim_job(connection: Connection, owner: str, seconds: float, version: str) -> Lease | None:
    """Claim the first job of the queue; see `Leases.claim`."""
    queued = and_(
        jobs.c.state == JobState.QUEUED,
        jobs.c.not_before <= now(),
        ~jobs.c.declined.contains(f",{version},", autoescape=True),
    )
    lost = and_(
        jobs.c.state == JobState.RUNNING, or_(jobs.c.lease_until < now(), jobs.c.lease_owner == owner)
    )
    # A condition for both states would sort all queued jobs. That for one state reads them in order from an
    # index, and lost leases are rare.
    any_lost = connection.execute(select(jobs.c.id).where(lost).limit(1)).one_or_none() is not None
    first = (
        select(jobs.c.id, jobs.c.stalled, jobs.c.cancel_requested, jobs.c.progress)
        .where(or_(queued, lost) if any_lost else queued)
        .order_by(jobs.c.priority.desc(), jobs.c.created, jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)
    )
    while (found := connection.execute(first).one_or_none()) is not None:
        if found.stalled >= ATTEMPTS:
            _give_up(connection, found)
            continue
        row = update_job(
            connection,
            found.id,
            state=JobState.RUNNING,
            lease_owner=owner,
            lease_epoch=jobs.c.lease_epoch + 1,
            lease_until=now() + seconds,
            attempt=jobs.c.attempt + 1,
            stalled=jobs.c.stalled + 1,
            started=func.coalesce(jobs.c.started, now()),
        )
        append_event(connection, row, "running", json.dumps({"attempt": row.attempt}))
        return Lease(job_from_row(row), row.lease_epoch)
    return None


def count_earlier_claims(connection: Connection, job: Job) -> int:
    """Return the number of queued jobs of all owners that precede a queued job in the order of claims."""
    # Two counts, each of a range of the index.
    queued = select(func.count()).where(jobs.c.state == JobState.QUEUED)
    higher = queued.where(jobs.c.priority > job.priority)
    older = queued.where(
        jobs.c.priority == job.priority, tuple_(jobs.c.created, jobs.c.id) < tuple_(job.created, job.id)
    )
    counts = select(higher.scalar_subquery(), older.scalar_subquery())
    return sum(connection.execute(counts).one())


def _give_up(connection: Connection, job: Any) -> None:
    """End a job that makes no progress: as cancelled if that was requested, else as failed."""
    note = (read_document(job.progress) or {}).get("note")
    problem = GAVE_UP if note is None else {**GAVE_UP, "detail": f"{GAVE_UP['detail']} (last: {note})"}
    row = update_job(
        connection,
        job.id,
        state=JobState.CANCELLED if job.cancel_requested else JobState.FAILED,
        lease_owner=None,
        finished=now(),
        problem=None if job.cancel_requested else json.dumps(problem),
    )
    append_event(connection, row, row.state, row.problem or "{}")
