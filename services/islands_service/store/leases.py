"""Operations of coordinators on jobs: claim, renew, report, release, finish.

The epoch of a lease is a fencing token. A coordinator owns a job while the epoch of its lease is that of the
job. Every write names its epoch, and a write with an older epoch changes nothing and raises `LeaseLostError`.
A coordinator that resumes after its lease was taken over therefore does no harm.
"""

import json
import re
from collections.abc import Iterable
from typing import Any

from sqlalchemy import (
    Connection,
    Row,
    Select,
    String,
    and_,
    bindparam,
    case,
    delete,
    func,
    insert,
    or_,
    select,
    update,
)

from islands_service.domain.job import (
    ISLANDS_VERSION,
    WAITING_PHASE,
    Job,
    JobOutcome,
    JobState,
    Lease,
    LeaseLostError,
    ProgressReport,
    Renewal,
)
from islands_service.store import dialect
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.fair_queue import (
    QueuePlace,
    charge_owner,
    find_places,
    has_room,
    list_deprived,
    rank_owners,
)
from islands_service.store.job_rows import (
    append_event,
    describe_result,
    find_error,
    job_from_row,
    read_document,
    update_job,
)
from islands_service.store.monitors import IS_NEXT_RECORD
from islands_service.store.results import replace_artefacts, store_result, to_text
from islands_service.store.tables import events, jobs, points

#: Progress events that are kept per job. A client that was away longer reads the job itself.
KEPT = 500

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


class Leases(DatabaseOperations):
    """Lease operations of the store, used by coordinators."""

    def claim(
        self,
        coordinator: str,
        seconds: float,
        version: str = ISLANDS_VERSION,
        most_running: int | None = None,
        most_islands: int | None = None,
    ) -> Lease | None:
        """Claim a job; None if no job can be claimed.

        First come running jobs whose lease has expired, or whose coordinator has the same name: only one
        process at a time has a name, so the previous one must have ended. Then the owners with queued jobs
        are served in turn, in proportion to their weights (`job_rows.fair_queue`); of each the oldest job of
        the highest priority. A queued job cannot be claimed while it waits for a repeated attempt, or if a
        coordinator of this version has declined it. While it exceeds the quota of islands, it and the jobs
        after it wait, unless the owner runs nothing.

        Parameters
        ----------
        coordinator : str
            Name of the coordinator.
        seconds : float
            Duration of the lease; `renew` extends it.
        version : str
            Version of islands of the coordinator.
        most_running, most_islands : int, optional
            Quotas of running jobs, and of their islands, of an owner for which none were set; unlimited by
            default.
        """
        asked = (coordinator, seconds, version, most_running, most_islands)
        return self._database.write(lambda connection: claim_job(connection, *asked))

    def is_turn_over(
        self,
        lease: Lease,
        version: str = ISLANDS_VERSION,
        most_running: int | None = None,
        most_islands: int | None = None,
    ) -> bool:
        """Return whether a job that can continue from its checkpoint should let another owner's job pass.

        That is so if an owner has a job that this coordinator could claim, and fewer running jobs, each in
        relation to its weight. The parameters are those of `claim`.
        """
        with self._database.read() as connection:
            return is_turn_over(connection, lease.job.owner, version, most_running, most_islands)

    def renew(self, lease: Lease, seconds: float, ran: float = 0.0) -> Renewal:
        """Extend a lease, and count the run time of its job.

        Parameters
        ----------
        seconds : float
            Duration of the lease from now.
        ran : float
            Seconds for which the job has run since the last renewal.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> Renewal:
            held = update(jobs).where(*_held(lease))
            renewed = held.values(lease_until=now() + seconds, run_seconds=jobs.c.run_seconds + ran)
            found = connection.execute(
                renewed.returning(
                    jobs.c.cancel_requested,
                    jobs.c.stop_requested,
                    jobs.c.run_seconds,
                    jobs.c.max_run_seconds,
                )
            ).one_or_none()
            if found is None:
                raise _make_lease_lost_error(lease)
            return Renewal(
                bool(found.cancel_requested),
                bool(found.stop_requested),
                found.run_seconds,
                found.max_run_seconds,
            )

        return self._database.write(operation)

    def queue_places(
        self, found: Iterable[Job], most_running: int | None = None, most_islands: int | None = None
    ) -> dict[str, QueuePlace]:
        """Return the places of the queued ones of some jobs; see `find_places`."""
        with self._database.read() as connection:
            return find_places(connection, found, most_running, most_islands)

    def read_requests(self, lease: Lease) -> tuple[bool, bool]:
        """Return whether a cancellation, and a stop of the search of a job are requested.

        The lease is neither checked nor extended.
        """
        query = select(jobs.c.cancel_requested, jobs.c.stop_requested).where(jobs.c.id == lease.job.id)
        with self._database.read() as connection:
            found = connection.execute(query).one_or_none()
        return (False, False) if found is None else (bool(found[0]), bool(found[1]))

    def report(self, lease: Lease, report: ProgressReport, urgent: bool = False) -> Job:
        """Store progress, history points and checkpoint of a job: all together or none of them.

        Parameters
        ----------
        urgent : bool
            See `Database.write`.

        Raises
        ------
        LeaseLostError
        """
        return self._database.write(lambda connection: _report(connection, lease, report), urgent)

    def count_attempt(self, lease: Lease, change: int) -> None:
        """Change the number of attempts of a job without a checkpoint. This is no event.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> None:
            counted = update(jobs).where(*_held(lease)).values(stalled=jobs.c.stalled + change)
            if connection.execute(counted).rowcount == 0:
                raise _make_lease_lost_error(lease)

        self._database.write(operation)

    def release(self, lease: Lease, attempted: bool = False, reason: str = "") -> None:
        """Return a job to the queue, to continue from its checkpoint, or cancel it if that was requested.

        Parameters
        ----------
        attempted : bool
            Whether this counts as an attempt, because the cause of the release may occur again.
        reason : str
            Shown to the owner as the note of the progress.

        Raises
        ------
        LeaseLostError
        """
        self._database.write(lambda connection: _release(connection, lease, attempted, reason))

    def postpone(self, lease: Lease, reason: str, seconds: float, attempted: bool = True) -> None:
        """Return a job to the queue after a failure that may pass.

        Parameters
        ----------
        reason : str
            Shown to the owner as the note of the progress.
        seconds : float
            Time until the next attempt; after each further attempt without a checkpoint it is twice as long.
        attempted : bool
            Whether this counts as an attempt.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> None:
            attempts = (
                connection.execute(select(jobs.c.stalled).where(jobs.c.id == lease.job.id)).scalar() or 1
            )
            _release(connection, lease, attempted, reason, not_before=now() + seconds * 2.0 ** (attempts - 1))

        self._database.write(operation)

    def decline(self, lease: Lease, reason: str, version: str = ISLANDS_VERSION) -> None:
        """Return a job to the queue for a coordinator of another version. This is no attempt.

        Parameters
        ----------
        reason : str
            Shown to the owner as the note of the progress.
        version : str
            Coordinators of this version do not claim the job again.

        Raises
        ------
        LeaseLostError
        """
        self._database.write(
            lambda connection: _release(
                connection, lease, False, reason, declined=jobs.c.declined + f",{version},"
            )
        )

    def finish(self, lease: Lease, outcome: JobOutcome) -> None:
        """Store the outcome of a job together with its result, and with the state of its monitor.

        Raises
        ------
        LeaseLostError
            The lease is no longer valid, or the monitor has changed since the job has read it.
        """

        def operation(connection: Connection) -> None:
            row = _update_fenced(
                connection,
                lease,
                state=outcome.state,
                finished=now(),
                lease_owner=None,
                # A job that has succeeded never continues: allow a sweep of its checkpoint.
                checkpoint=None if outcome.state == JobState.SUCCEEDED else jobs.c.checkpoint,
                summary=to_text(outcome.summary),
                search_result=describe_result(outcome.summary),
                model_error=find_error(outcome.summary),
                problem=to_text(outcome.problem),
                result_version=jobs.c.result_version if outcome.document is None else ISLANDS_VERSION,
            )
            store_result(connection, row.id, outcome)
            append_event(connection, row, outcome.state, to_text(outcome.problem or outcome.summary) or "{}")

        self._database.write(operation)


def _release(connection: Connection, lease: Lease, attempted: bool, reason: str = "", **values: Any) -> None:
    if reason:
        reached = connection.execute(select(jobs.c.progress).where(jobs.c.id == lease.job.id)).scalar()
        values["progress"] = to_text(
            {**(read_document(reached) or {}), "phase": WAITING_PHASE, "note": reason}
        )
    row = _update_fenced(
        connection,
        lease,
        state=case((jobs.c.cancel_requested, JobState.CANCELLED), else_=JobState.QUEUED),
        finished=case((jobs.c.cancel_requested, now())),
        lease_owner=None,
        attempt=jobs.c.attempt - int(not attempted),
        stalled=case((jobs.c.stalled > 0, jobs.c.stalled - int(not attempted)), else_=0),
        **values,
    )
    append_event(connection, row, row.state, json.dumps({"note": reason} if reason else {}))


def _report(connection: Connection, lease: Lease, report: ProgressReport) -> Job:
    values: dict[str, Any] = {"progress": to_text(report.progress)}
    if report.checkpoint is not None:
        values |= {"checkpoint": report.checkpoint, "checkpoint_version": ISLANDS_VERSION, "stalled": 0}
    row = _update_fenced(connection, lease, **values)
    if report.points:
        # After a crash the same generations are reported again with equal values.
        behind = points.c.generation > report.after
        connection.execute(delete(points).where(points.c.job_id == row.id, behind))
        connection.execute(
            insert(points),
            [
                {
                    "job_id": row.id,
                    "generation": generation,
                    "evaluations": evaluations,
                    "best": json.dumps(dict(best)),
                    "islands": json.dumps(least),
                }
                for generation, evaluations, best, least in report.points
            ],
        )
    replace_artefacts(connection, row.id, report.artefacts)
    connection.execute(
        delete(events).where(
            events.c.job_id == row.id, events.c.kind == "progress", events.c.number <= row.version - KEPT
        )
    )
    append_event(connection, row, "progress", row.progress)
    return job_from_row(row)


def _held(lease: Lease) -> tuple[Any, ...]:
    return (
        jobs.c.id == lease.job.id,
        jobs.c.lease_epoch == lease.epoch,
        jobs.c.state == JobState.RUNNING,
    )


def _update_fenced(connection: Connection, lease: Lease, **values: Any) -> Row[Any]:
    """Update a job and return its row, or raise `LeaseLostError` if the lease is no longer valid."""
    row = connection.execute(
        update(jobs)
        .where(*_held(lease))
        .values(version=jobs.c.version + 1, updated=now(), **values)
        .returning(jobs)
    ).one_or_none()
    if row is None:
        raise _make_lease_lost_error(lease)
    return row


def _make_lease_lost_error(lease: Lease) -> LeaseLostError:
    return LeaseLostError(f"the lease of job {lease.job.id} is lost (epoch {lease.epoch})")


def claim_job(
    connection: Connection,
    coordinator: str,
    seconds: float,
    version: str,
    most_running: int | None,
    most_islands: int | None,
) -> Lease | None:
    """Claim a lost job, or the first queued job of the owner whose turn it is; see `Leases.claim`."""
    while (row := _select_lost(connection, coordinator, seconds)) is not None:
        if row.stalled < ATTEMPTS:
            return _lease_job(connection, row.id, coordinator, seconds)
        _give_up(connection, row)
    dialect.lock_claims(connection)
    with rank_owners(connection, most_running, most_islands) as turns:
        for turn in turns:
            if not _fits_first(connection, turn, version):
                # Smaller jobs behind the first one wait too: otherwise they could delay it for ever.
                continue
            while (row := _select_queued(connection, turn.name, version)) is not None:
                if row.stalled >= ATTEMPTS:
                    _give_up(connection, row)
                elif has_room(turn, row.islands):
                    charge_owner(connection, turn)
                    return _lease_job(connection, row.id, coordinator, seconds)
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
