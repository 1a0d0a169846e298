"""Updates of jobs and their events. Each update raises the version of the job, the number of its event."""

import json
from typing import Any

from sqlalchemy import Connection, Row, insert, update

from islands_service.domain.job import TERMINAL, Job, JobState
from islands_service.store.backends.dialect import now
from islands_service.store.job_rows.job_search import split_tags
from islands_service.store.tables import events, jobs
from islands_service.store.tenants.deliveries import queue_deliveries

_INSERT_EVENT = insert(events)


def update_job(connection: Connection, job: str, **values: Any) -> Row[Any]:
    """Update a job, raise its version, and return the new row."""
    return connection.execute(
        update(jobs)
        .where(jobs.c.id == job)
        .values(version=jobs.c.version + 1, updated=now(), **values)
        .returning(jobs)
    ).one()


def cancel_job(connection: Connection, job: Row[Any]) -> Row[Any]:
    """Cancel a queued job, or request cancellation of a running one; return the new row."""
    waiting = job.state == JobState.QUEUED
    row = update_job(
        connection,
        job.id,
        cancel_requested=True,
        state=JobState.CANCELLED if waiting else job.state,
        finished=now() if waiting else None,
    )
    append_event(connection, row, "cancelled" if waiting else "cancelling")
    return row


def append_event(connection: Connection, row: Row[Any], kind: str, data: str = "{}") -> None:
    """Append the event of the current version of a job; at its end also to the outbox of webhooks."""
    values = {"job_id": row.id, "number": row.version, "kind": kind, "data": data, "at": row.updated}
    connection.execute(_INSERT_EVENT, values)
    if kind in TERMINAL:
        queue_deliveries(connection, row)


def job_from_row(row: Row[Any]) -> Job:
    """Return the `Job` of a row."""
    return Job(
        row.id,
        row.owner,
        row.kind,
        row.name,
        json.loads(row.spec),
        row.priority,
        JobState(row.state),
        row.version,
        row.attempt,
        bool(row.cancel_requested),
        bool(row.stop_requested),
        read_document(row.progress),
        row.checkpoint,
        read_document(row.summary),
        read_document(row.problem),
        row.run_seconds,
        row.max_run_seconds,
        row.created,
        row.updated,
        row.started,
        row.finished,
        {
            "job": row.islands_version,
            "checkpoint": row.checkpoint_version,
            "result": row.result_version,
        },
        split_tags(row.tags),
        row.dataset_name,
    )


def read_document(text: str | None) -> dict[str, Any] | None:
    """Parse a column that contains JSON."""
    return None if text is None else dict(json.loads(text))


def without_note(progress: str | None) -> str | None:
    """Return the text of a progress without the note of the attempt that wrote it."""
    document = read_document(progress)
    return None if document is None else json.dumps({k: v for k, v in document.items() if k != "note"})
