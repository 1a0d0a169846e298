"""Deletion of expired jobs, and the blobs that are still referenced."""

from sqlalchemy import Connection, delete, select, union

from islands_service.domain.job import TERMINAL
from islands_service.store.database import Database
from islands_service.store.dialect import now
from islands_service.store.tables import artefacts, datasets, jobs


class Retention:
    """Retention operations of the store.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def delete_expired(self, seconds: float) -> int:
        """Delete the jobs that finished more than the given seconds ago; return their number."""

        def operation(connection: Connection) -> int:
            old = jobs.c.state.in_(TERMINAL) & (jobs.c.finished < now() - seconds)
            return len(connection.execute(delete(jobs).where(old).returning(jobs.c.id)).all())

        return self._database.write(operation)

    def named_blobs(self) -> frozenset[str]:
        """Return all blobs that a row references."""
        query = union(
            select(datasets.c.blob),
            select(artefacts.c.blob),
            select(jobs.c.checkpoint).where(jobs.c.checkpoint.is_not(None)),
        )
        with self._database.read() as connection:
            return frozenset(connection.execute(query).scalars())
