"""What may go: finished jobs after their time, and blobs that nobody names."""

from sqlalchemy import Connection, delete, select, union

from islands_service.domain.job import TERMINAL
from islands_service.store.database import Database
from islands_service.store.dialect import now
from islands_service.store.tables import artefacts, datasets, jobs


class Retention:
    """The part of the store that forgets.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def delete_expired(self, seconds: float) -> int:
        """Delete the jobs that were finished so long ago; return how many."""

        def operation(connection: Connection) -> int:
            old = jobs.c.state.in_(TERMINAL) & (jobs.c.finished < now() - seconds)
            return len(connection.execute(delete(jobs).where(old).returning(jobs.c.id)).all())

        return self._database.write(operation)

    def named_blobs(self) -> frozenset[str]:
        """Return all blobs that something needs."""
        query = union(
            select(datasets.c.blob),
            select(artefacts.c.blob),
            select(jobs.c.checkpoint).where(jobs.c.checkpoint.is_not(None)),
        )
        with self._database.read() as connection:
            return frozenset(connection.execute(query).scalars())
