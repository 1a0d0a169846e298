"""Results of jobs: the rows that the outcome of a job adds, in the transaction that ends it."""

import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, delete, insert

from islands_service.domain.job import JobOutcome
from islands_service.store.job_rows.monitor_records import update_monitor
from islands_service.store.tables import artefacts, models, results


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
