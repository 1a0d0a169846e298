"""Results of jobs: history, result document, models and artefacts."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from islands_service.domain.job import JobNotFoundError, JobOutcome
from islands_service.store.database import DatabaseOperations
from islands_service.store.monitors import update_monitor
from islands_service.store.tables import artefacts, jobs, models, points, results


@dataclass(frozen=True, slots=True)
class StoredModel:
    """A model of a result: its entry in the result document, and its model file as text."""

    rank: int
    document: Mapping[str, Any]
    file: str


class Results(DatabaseOperations):
    """Result operations of the store."""

    def history(self, job: str, after: int = -1, limit: int | None = None) -> list[list[Any]]:
        """Return points after a generation, each a list: generation, evaluations, best, islands."""
        query = (
            select(points)
            .where(points.c.job_id == job, points.c.generation > after)
            .order_by(points.c.generation)
            .limit(limit)
        )
        with self._database.read() as connection:
            return [
                [row.generation, row.evaluations, json.loads(row.best), json.loads(row.islands)]
                for row in connection.execute(query)
            ]

    def document(self, job: str) -> dict[str, Any] | None:
        """Return the result document without its models; None if there is no result yet."""
        with self._database.read() as connection:
            text = connection.execute(select(results.c.document).where(results.c.job_id == job)).scalar()
        return None if text is None else dict(json.loads(text))

    def models(self, job: str, rank: int | None = None) -> list[StoredModel]:
        """Return the models of a job in the order of their ranks, or only the one of a rank."""
        query = select(models).where(models.c.job_id == job).order_by(models.c.rank)
        if rank is not None:
            query = query.where(models.c.rank == rank)
        with self._database.read() as connection:
            return [
                StoredModel(row.rank, json.loads(row.document), row.file) for row in connection.execute(query)
            ]

    def artefact(self, job: str, name: str) -> str | None:
        """Return the blob of an artefact; None if it has not been made yet."""
        query = select(artefacts.c.blob).where(artefacts.c.job_id == job, artefacts.c.name == name)
        with self._database.read() as connection:
            return connection.execute(query).scalar()

    def keep(self, job: str, blobs: Mapping[str, str]) -> None:
        """Store artefacts of a result, given as blobs by name.

        Raises
        ------
        JobNotFoundError
            The job was deleted meanwhile.
        """

        def operation(connection: Connection) -> None:
            # Lock the job: concurrent processes may have made the same artefacts, and must see each other's
            # rows.
            locked = connection.execute(select(jobs.c.id).where(jobs.c.id == job).with_for_update())
            if locked.one_or_none() is None:
                raise JobNotFoundError(f"there is no job {job!r} any more")
            replace_artefacts(connection, job, blobs)

        self._database.write(operation)


def store_result(connection: Connection, job: str, outcome: JobOutcome) -> None:
    """Replace the result of a job, and store the new state of its monitor.

    Parameters
    ----------
    connection : Connection
        In the transaction that ends the job.
    job : str
    outcome : JobOutcome
        Without a document the previous result is kept.

    Raises
    ------
    LeaseLostError
        See `update_monitor`.
    """
    if outcome.document is not None:
        # Also delete the artefacts, which belong to the previous result.
        for table in (results, models, artefacts):
            connection.execute(delete(table).where(table.c.job_id == job))
        connection.execute(insert(results).values(job_id=job, document=to_text(outcome.document)))
        for rank, (document, file) in enumerate(outcome.models, start=1):
            values = {"job_id": job, "rank": rank, "document": to_text(document), "file": file}
            connection.execute(insert(models).values(values))
        replace_artefacts(connection, job, outcome.artefacts)
    if outcome.monitor is not None:
        update_monitor(connection, job, outcome.monitor)


def replace_artefacts(connection: Connection, job: str, blobs: Mapping[str, str]) -> None:
    """Store artefacts of a job, given as blobs by name, in place of those of equal names."""
    if blobs:
        named = artefacts.c.name.in_(blobs)
        connection.execute(delete(artefacts).where(artefacts.c.job_id == job, named))
        rows = [{"job_id": job, "name": name, "blob": blob} for name, blob in blobs.items()]
        connection.execute(insert(artefacts), rows)


def to_text(document: Any) -> str | None:
    """Return a document as JSON; None for None."""
    return None if document is None else json.dumps(document)
