"""Rows of jobs: read, updated with their events, searched and deleted.

Each update raises the version of the job, the number of its event. The texts of a search are folded by
Python, since the databases fold only ASCII (SQLite) or by their locale (PostgreSQL).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any
from unicodedata import normalize

from sqlalchemy import ColumnElement, Connection, Row, and_, delete, exists, insert, or_, select, update

from islands_service.domain.job import TERMINAL, Job, JobState
from islands_service.store.dialect import now, position
from islands_service.store.tables import datasets, events, jobs, retired_keys
from islands_service.store.webhooks import queue_deliveries

_INSERT_EVENT = insert(events)

#: Entries of a summary by which a result is found: a model, a diagnosis, a record of a monitor.
_RESULT = ("equation", "simulation", "verdict", "effects", "status")


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


def join_tags(tags: Iterable[str]) -> str:
    """Return tags as the text of their column, without repetitions: ``,a,b,``."""
    different = tuple(dict.fromkeys(tags))
    return f",{','.join(different)}," if different else ""


def split_tags(text: str) -> tuple[str, ...]:
    """Return the tags of the text of their column."""
    return tuple(filter(None, text.split(",")))


def fold(text: str) -> str:
    """Return a text in which equal words are equal in every case and every form of their accents."""
    return normalize("NFKC", text).casefold()


def describe_labels(name: str, tags: str, dataset_name: str | None) -> str:
    """Return the text by which a search finds a job from its submission on, given the text of its tags."""
    return fold("\n".join([name, *split_tags(tags), dataset_name or ""]))


def describe_result(summary: Mapping[str, Any] | None) -> str:
    """Return the text by which a search finds the result of a job; empty without one."""
    entries = [(summary or {}).get(name) for name in _RESULT]
    texts = [each for entry in entries for each in (entry if isinstance(entry, list) else [entry])]
    return fold("\n".join(str(text) for text in texts if text))


def find_error(summary: Mapping[str, Any] | None) -> float | None:
    """Return the error of the recommended model in per cent of the range of its output; None without one."""
    error = ((summary or {}).get("metrics") or {}).get("mape")
    return error if isinstance(error, float) and isfinite(error) else None


def has_tag(tag: str) -> ColumnElement[bool]:
    """Return the condition that a job has a tag."""
    return position(jobs.c.tags, f",{tag},") > 0


def has_words(words: Sequence[str]) -> list[ColumnElement[bool]]:
    """Return the conditions that a job has each of some words, anywhere in its labels or its result."""
    return [
        or_(position(jobs.c.search_labels, word) > 0, position(jobs.c.search_result, word) > 0)
        for word in map(fold, words)
    ]


def delete_job(connection: Connection, job: Row[Any]) -> None:
    """Delete a finished job on request of its owner, and keep its idempotency key."""
    connection.execute(delete(jobs).where(jobs.c.id == job.id))
    if job.idempotency_key is not None:
        values = {
            "owner": job.owner,
            "idempotency_key": job.idempotency_key,
            "job_id": job.id,
            "request_sha256": job.request_sha256,
            "finished": job.finished,
        }
        connection.execute(insert(retired_keys).values(values))
    delete_unused_datasets(connection, job.owner)


def delete_unused_datasets(connection: Connection, owner: str | None = None) -> None:
    """Delete the rows of deleted data sets that no job names; those of one owner, or of all."""
    # The specification names data sets in quotes. The id contains no wildcard.
    named = exists(
        select(jobs.c.id).where(
            jobs.c.owner == datasets.c.owner, jobs.c.spec.like('%"' + datasets.c.id + '"%')
        )
    )
    unused = and_(datasets.c.deleted.is_not(None), ~named)
    connection.execute(
        delete(datasets).where(unused if owner is None else and_(datasets.c.owner == owner, unused))
    )
