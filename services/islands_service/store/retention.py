"""Deletion of expired jobs, and the blobs that are still referenced."""

from typing import Any

from sqlalchemy import Column, ColumnElement, Connection, delete, select, union

from islands_service.domain.job import TERMINAL
from islands_service.store.backends.dialect import now
from islands_service.store.database import Database
from islands_service.store.job_rows.job_deletion import delete_unused_datasets
from islands_service.store.tables import artefacts, audit, datasets, jobs, retired_keys

#: Rows that are deleted in one transaction. A job has some thousands of events and points.
JOBS_AT_ONCE, ENTRIES_AT_ONCE = 50, 10_000


class Retention:
    """Retention operations of the store.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def delete_expired(self, seconds: float) -> int:
        """Delete the jobs that finished more than the given seconds ago; return their number.

        Idempotency keys of jobs that finished as long ago and were deleted before can be used again.
        """
        old = jobs.c.state.in_(TERMINAL) & (jobs.c.finished < now() - seconds)
        deleted = self._delete(jobs.c.id, old, JOBS_AT_ONCE)

        def operation(connection: Connection) -> None:
            connection.execute(delete(retired_keys).where(retired_keys.c.finished < now() - seconds))
            delete_unused_datasets(connection)

        self._database.write(operation)
        return deleted

    def delete_old_audit(self, seconds: float) -> None:
        """Delete the audit entries that are older than the given seconds."""
        self._delete(audit.c.number, audit.c.at < now() - seconds, ENTRIES_AT_ONCE)

    def _delete(self, key: Column[Any], old: ColumnElement[bool], at_once: int) -> int:
        """Delete the old rows of a table in several transactions; return their number.

        A long transaction would delay the heartbeats of this process for longer than a lease.
        """
        # The condition is repeated: a job may be resumed after it was selected.
        some = delete(key.table).where(old, key.in_(select(key).where(old).limit(at_once))).returning(key)
        deleted = 0
        while found := len(self._database.write(lambda connection: connection.execute(some).all())):
            deleted += found
            if found < at_once:
                break
        return deleted

    def read_clock(self) -> float:
        """Return the clock of the database in seconds since 1970."""
        with self._database.read() as connection:
            return float(connection.execute(select(now())).scalar_one())

    def named_blobs(self) -> frozenset[str]:
        """Return all blobs that a row references."""
        with self._database.read() as connection:
            return self.named_blobs_of(connection)

    @staticmethod
    def named_blobs_of(connection: Connection) -> frozenset[str]:
        """Return all blobs that a row references, as a connection sees the rows."""
        query = union(
            select(datasets.c.blob),
            select(artefacts.c.blob),
            select(jobs.c.checkpoint).where(jobs.c.checkpoint.is_not(None)),
        )
        return frozenset(connection.execute(query).scalars())
