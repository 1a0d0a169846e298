"""Claims of jobs, and the end of a job without progress."""

import json
import re
from typing import Any

from sqlalchemy import Connection, Row, Select, String, and_, bindparam, func, or_, select

from islands_service.domain.job import JobState, Lease
from islands_service.store.backends import dialect
from islands_service.store.backends.dialect import now
from islands_service.store.job_rows.fair_queue import charge_owner, has_room, list_deprived, rank_owners
from islands_service.store.job_rows.job_events import append_event, job_from_row, read_document, update_job
from islands_service.store.job_rows.monitor_records import IS_NEXT_RECORD
from islands_service.store.tables import jobs

#: Attempts since the last checkpoint after which a job is given up.
ATTEMPTS = 5

_CANDIDATE: Select[Any] = select(
    jobs.c.id, jobs.c.stalled, jobs.c.cancel_requested, jobs.c.progress, jobs.c.islands
).limit(1)

#: True if the clock of the database has gone back by more than a second since the last change of a job. Times
#: that were set before may lie far in the future.
_CLOCK_WENT_BACK = jobs.c.updated > now() + 1.0

# Built once, since building a statement takes longer than executing it.
_FIRST = _CANDIDATE.where(
    jobs.c.state == JobState.QUEUED,
    jobs.c.owner == bindparam("owner", type_=String),
    or_(jobs.c.not_before <= now(), _CLOCK_WENT_BACK),
    ~jobs.c.declined.contains(bindparam("version", type_=String), escape="/"),
    IS_NEXT_RECORD,
).order_by(jobs.c.priority.desc(), jobs.c.created, jobs.c.id)
_FIRST_LOCKED = _FIRST.with_for_update(skip_locked=True)

#: Problem of a job that failed after `ATTEMPTS` attempts.
GAVE_UP = {
    "type": "no-progress",
    "title": "The job was given up",
    "detail": f"{ATTEMPTS} attempts ended without progress, most likely for lack of memory: "
    "use fewer islands, smaller populations or a shorter record, and resume or submit it again",
}


def claim_job(
    connection: Connection,
    coordinator: str,
    seconds: float,
    version: str,
    most_running: int | None,
    most_islands: int | None,
) -> Lease | None:
    """Claim a lost job, or the first queued job of the owner whose turn it is; see `Leases.claim`."""
    while (found := _select_lost(connection, coordinator, seconds)) is not None:
        if found.stalled < ATTEMPTS:
            return _lease_job(connection, found.id, coordinator, seconds)
        _give_up(connection, found)
    dialect.lock_claims(connection)
    with rank_owners(connection, most_running, most_islands) as turns:
        for turn in turns:
            if not _fits_first(connection, turn, version):
                # Smaller jobs behind the first one wait too: otherwise they could delay it for ever.
                continue
            while (found := _select_queued(connection, turn.name, version)) is not None:
                if found.stalled >= ATTEMPTS:
                    _give_up(connection, found)
                elif has_room(turn, found.islands):
                    charge_owner(connection, turn)
                    return _lease_job(connection, found.id, coordinator, seconds)
                else:
                    break
    return None


def is_turn_over(
    connection: Connection, owner: str, version: str, most_running: int | None, most_islands: int | None
) -> bool:
    """Return whether another owner has a job that can be claimed; see `Leases.is_turn_over`."""
    return any(
        (found := _select_queued(connection, turn.name, version, locked=False)) is not None
        and has_room(turn, found.islands)
        for turn in list_deprived(connection, owner, most_running, most_islands)
    )


def _select_lost(connection: Connection, coordinator: str, seconds: float) -> Row[Any] | None:
    """Return a running job whose coordinator has ended. Its owner has had the turn already."""
    # A coordinator that runs renews its lease by the new clock, for a short time from now.
    never_expires = and_(jobs.c.lease_until > now() + seconds, _CLOCK_WENT_BACK)
    ended = or_(jobs.c.lease_until < now(), jobs.c.lease_owner == coordinator, never_expires)
    query = _CANDIDATE.where(jobs.c.state == JobState.RUNNING, ended).order_by(jobs.c.created, jobs.c.id)
    return connection.execute(query.with_for_update(skip_locked=True)).one_or_none()


def _fits_first(connection: Connection, turn: Row[Any], version: str) -> bool:
    """Return whether an owner may run the first of its queued jobs.

    The row is not locked: in PostgreSQL a lock is a write, which each attempt of a coordinator would repeat
    while the job waits. A job that a client cancels at this moment is not passed over either.
    """
    if turn.most_islands is None or turn.islands == 0:
        return True
    first = _select_queued(connection, turn.name, version, locked=False)
    return first is None or first.stalled >= ATTEMPTS or has_room(turn, first.islands)


def _select_queued(connection: Connection, owner: str, version: str, locked: bool = True) -> Row[Any] | None:
    escaped = re.sub("[/%_]", r"/\g<0>", version)
    values = {"owner": owner, "version": f",{escaped},"}
    return connection.execute(_FIRST_LOCKED if locked else _FIRST, values).one_or_none()


def _lease_job(connection: Connection, job: str, coordinator: str, seconds: float) -> Lease:
    row = update_job(
        connection,
        job,
        state=JobState.RUNNING,
        lease_owner=coordinator,
        lease_epoch=jobs.c.lease_epoch + 1,
        lease_until=now() + seconds,
        attempt=jobs.c.attempt + 1,
        stalled=jobs.c.stalled + 1,
        started=func.coalesce(jobs.c.started, now()),
    )
    append_event(connection, row, "running", json.dumps({"attempt": row.attempt}))
    return Lease(job_from_row(row), row.lease_epoch, is_last=row.stalled >= ATTEMPTS)


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
