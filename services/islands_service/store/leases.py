"""What coordinators do with jobs: claim one, keep it, tell of it, finish it.

A coordinator owns a job as long as its lease's epoch is the job's. Every write names its epoch, and a write
under an older epoch changes nothing (`LeaseLostError`): a coordinator that was taken for dead and goes on
does no harm.
"""

import json
from typing import Any

from sqlalchemy import Connection, Row, and_, case, delete, func, insert, or_, select, update

from islands_service.domain.job import Job, JobOutcome, JobState, Lease, LeaseLostError, ProgressReport
from islands_service.store.database import Database
from islands_service.store.dialect import now
from islands_service.store.job_events import append_event, job_from_row, update_job
from islands_service.store.tables import artefacts, events, jobs, models, points, results

#: Attempts that may fail to bring a job on, one after the other, before it is given up.
ATTEMPTS = 5

#: Events of progress that are kept of a job: who was away longer reads the job itself.
KEPT = 500

#: Why a job was given up that nobody could bring on.
GIVEN_UP = {
    "type": "no-progress",
    "title": "The job was given up",
    "detail": f"{ATTEMPTS} attempts ended without bringing the job on, most likely for lack of memory: "
    "take fewer islands, smaller populations or a shorter record, and resume or submit it again",
}


class Leases:
    """The part of the store that coordinators use.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def claim(self, owner: str, seconds: float) -> Lease | None:
        """Take the job that has waited longest among those of the highest priority.

        A running job may be taken if its lease has expired, or if it has our own name on it: one process at
        a time has a name, so that one must be gone.

        Parameters
        ----------
        owner : str
            The coordinator's name.
        seconds : float
            For how long; `beat` prolongs it.
        """
        return self._database.write(lambda connection: _claim(connection, owner, seconds))

    def renew(self, lease: Lease, seconds: float) -> bool:
        """Prolong a lease; tell whether the job is to be cancelled.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> bool:
            held = update(jobs).where(*_held(lease)).values(lease_until=now() + seconds)
            found = connection.execute(held.returning(jobs.c.cancel_requested)).one_or_none()
            if found is None:
                raise _lost(lease)
            return bool(found.cancel_requested)

        return self._database.write(operation)

    def report(self, lease: Lease, report: ProgressReport) -> Job:
        """Tell how far a job is; with a checkpoint, all of it counts or nothing.

        Raises
        ------
        LeaseLostError
        """
        return self._database.write(lambda connection: _report(connection, lease, report))

    def release(self, lease: Lease, attempted: bool = False) -> None:
        """Give a job back to the queue: it goes on from its checkpoint, and this was no attempt.

        One that is to be cancelled is cancelled instead: nobody has it any more.

        Parameters
        ----------
        attempted : bool
            It was one: something failed that may fail again.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> None:
            row = _fenced(
                connection,
                lease,
                state=case((jobs.c.cancel_requested, JobState.CANCELLED), else_=JobState.QUEUED),
                finished=case((jobs.c.cancel_requested, now())),
                lease_owner=None,
                attempt=jobs.c.attempt - int(not attempted),
                stalled=case((jobs.c.stalled > 0, jobs.c.stalled - int(not attempted)), else_=0),
            )
            append_event(connection, row, row.state)

        self._database.write(operation)

    def finish(self, lease: Lease, outcome: JobOutcome) -> None:
        """Write down how a job ended, with all that belongs to its result.

        Raises
        ------
        LeaseLostError
        """

        def operation(connection: Connection) -> None:
            row = _fenced(
                connection,
                lease,
                state=outcome.state,
                finished=now(),
                lease_owner=None,
                # What has succeeded never goes on: its checkpoint may be swept away.
                checkpoint=None if outcome.state == JobState.SUCCEEDED else jobs.c.checkpoint,
                summary=_text(outcome.summary),
                problem=_text(outcome.problem),
            )
            if outcome.document is not None:
                # Figures, too, are of the result before.
                for table in (results, models, artefacts):
                    connection.execute(delete(table).where(table.c.job_id == row.id))
                connection.execute(insert(results).values(job_id=row.id, document=_text(outcome.document)))
                for rank, (document, file) in enumerate(outcome.models, start=1):
                    values = {"job_id": row.id, "rank": rank, "document": _text(document), "file": file}
                    connection.execute(insert(models).values(values))
                for name, blob in outcome.artefacts.items():
                    connection.execute(insert(artefacts).values(job_id=row.id, name=name, blob=blob))
            append_event(connection, row, outcome.state, _text(outcome.problem or outcome.summary) or "{}")

        self._database.write(operation)


def _claim(connection: Connection, owner: str, seconds: float) -> Lease | None:
    takes = or_(
        jobs.c.state == JobState.QUEUED,
        and_(jobs.c.state == JobState.RUNNING, or_(jobs.c.lease_until < now(), jobs.c.lease_owner == owner)),
    )
    first = (
        select(jobs.c.id, jobs.c.stalled, jobs.c.cancel_requested)
        .where(takes)
        .order_by(jobs.c.priority.desc(), jobs.c.created, jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)
    )
    while (found := connection.execute(first).one_or_none()) is not None:
        if found.stalled >= ATTEMPTS:
            _give_up(connection, found.id, found.cancel_requested)
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


def _give_up(connection: Connection, job: str, cancelled: bool) -> None:
    """End a job that nobody could bring on; one that was to be cancelled is cancelled."""
    row = update_job(
        connection,
        job,
        state=JobState.CANCELLED if cancelled else JobState.FAILED,
        lease_owner=None,
        finished=now(),
        problem=None if cancelled else _text(GIVEN_UP),
    )
    append_event(connection, row, row.state, row.problem or "{}")


def _report(connection: Connection, lease: Lease, report: ProgressReport) -> Job:
    values: dict[str, Any] = {"progress": _text(report.progress)}
    if report.checkpoint is not None:
        values |= {"checkpoint": report.checkpoint, "stalled": 0}
    row = _fenced(connection, lease, **values)
    if report.points:
        # After a crash the same generations come once more, and are the same.
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


def _fenced(connection: Connection, lease: Lease, **values: Any) -> Row[Any]:
    """Change a job that is still ours."""
    row = connection.execute(
        update(jobs)
        .where(*_held(lease))
        .values(version=jobs.c.version + 1, updated=now(), **values)
        .returning(jobs)
    ).one_or_none()
    if row is None:
        raise _lost(lease)
    return row


def _lost(lease: Lease) -> LeaseLostError:
    return LeaseLostError(f"job {lease.job.id} is not ours any more (lease {lease.epoch})")


def _text(document: Any) -> str | None:
    return None if document is None else json.dumps(document)
