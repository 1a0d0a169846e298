"""What jobs brought: history, result, models, and what was made of them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, delete, insert, select

from islands_service.domain.job import JobNotFoundError
from islands_service.store.database import Database
from islands_service.store.tables import artefacts, jobs, models, points, results


@dataclass(frozen=True, slots=True)
class StoredModel:
    """A model of a result: its entry of the result, and its model file as text."""

    rank: int
    document: Mapping[str, Any]
    file: str


class Results:
    """The part of the store that holds what jobs brought.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def history(self, job: str, after: int = -1, limit: int | None = None) -> list[list[Any]]:
        """Return the points of a search after a generation: generation, evaluations, best, islands."""
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
        """Return a result without its models; None where there is none yet."""
        with self._database.read() as connection:
            text = connection.execute(select(results.c.document).where(results.c.job_id == job)).scalar()
        return None if text is None else dict(json.loads(text))

    def models(self, job: str, rank: int | None = None) -> list[StoredModel]:
        """Return the models of a job, best first, or the one of a rank."""
        query = select(models).where(models.c.job_id == job).order_by(models.c.rank)
        if rank is not None:
            query = query.where(models.c.rank == rank)
        with self._database.read() as connection:
            return [
                StoredModel(row.rank, json.loads(row.document), row.file) for row in connection.execute(query)
            ]

    def artefact(self, job: str, name: str) -> str | None:
        """Return the blob of what was made of a result, None where it was not made yet."""
        query = select(artefacts.c.blob).where(artefacts.c.job_id == job, artefacts.c.name == name)
        with self._database.read() as connection:
            return connection.execute(query).scalar()

    def keep(self, job: str, blobs: Mapping[str, str]) -> None:
        """Keep what was made of a result, by name: blobs.

        Raises
        ------
        JobNotFoundError
            It was deleted meanwhile.
        """

        def operation(connection: Connection) -> None:
            # Locked: others may have drawn the same, and one has to see what the other has kept.
            there = connection.execute(select(jobs.c.id).where(jobs.c.id == job).with_for_update())
            if there.one_or_none() is None:
                raise JobNotFoundError(f"there is no job {job!r} any more")
            connection.execute(
                delete(artefacts).where(artefacts.c.job_id == job, artefacts.c.name.in_(blobs))
            )
            for name, blob in blobs.items():
                connection.execute(insert(artefacts).values(job_id=job, name=name, blob=blob))

        self._database.write(operation)
