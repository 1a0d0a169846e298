"""Deletion of jobs: their idempotency keys are kept, and deleted data sets that no job names any more go."""

from typing import Any

from sqlalchemy import Connection, Row, and_, delete, exists, insert, select

from islands_service.store.tables import datasets, jobs, retired_keys


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
