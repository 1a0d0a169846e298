"""Deletion of expired jobs, and the blobs that are still referenced."""

from sqlalchemy import Connection, delete, select, union

from islands_service.domain.job import TERMINAL
from islands_service.store.backends.dialect import now
from islands_service.store.database import Database
from islands_service.store.job_rows.job_deletion import delete_unused_datasets
from islands_service.store.tables import artefacts, audit, datasets, jobs, retired_keys


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

        def operation(connection: Connection) -> int:
            old = jobs.c.state.in_(TERMINAL) & (jobs.c.finished < now() - seconds)
            deleted = len(connection.execute(delete(jobs).where(old).returning(jobs.c.id)).all())
            connection.execute(delete(retired_keys).where(retired_keys.c.finished < now() - seconds))
            delete_unused_datasets(connection)
            return deleted

        return self._database.write(operation)

    def delete_old_audit(self, seconds: float) -> None:
        """Delete the audit entries that are older than the given seconds."""
        self._database.write(
            lambda connection: connection.execute(delete(audit).where(audit.c.at < now() - seconds))
        )

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
