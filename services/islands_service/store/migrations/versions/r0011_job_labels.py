"""Tags of jobs, the name of their data set, the texts that a search reads, and the error of their model.

A job that a running process of the previous release accepts or ends is not found by a search until its next
change, and is not in the list by error.
"""

import json
from math import isfinite
from unicodedata import normalize

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"

_jobs = sa.table(
    "jobs",
    *map(sa.column, ("id", "owner", "name", "spec", "summary", "dataset_name")),
    *map(sa.column, ("search_labels", "search_result", "model_error")),
)
_datasets = sa.table("datasets", *map(sa.column, ("owner", "id", "name")))

#: As in the search of this revision.
_RESULT = ("equation", "simulation", "verdict", "effects", "status")


def upgrade() -> None:
    """Add the columns, and fill them for the jobs that exist."""
    for name in ("tags", "search_labels", "search_result"):
        op.add_column("jobs", sa.Column(name, sa.Text, nullable=False, server_default=""))
    op.add_column("jobs", sa.Column("dataset_name", sa.String(255)))
    op.add_column("jobs", sa.Column("model_error", sa.Float))
    has_error = sa.text("model_error IS NOT NULL")
    op.create_index(
        "ix_jobs_model_error",
        "jobs",
        ["owner", "model_error", "id"],
        sqlite_where=has_error,
        postgresql_where=has_error,
    )
    connection = op.get_bind()
    names = {(row.owner, row.id): row.name for row in connection.execute(sa.select(_datasets))}
    # One row at a time: those of all jobs may not fit into memory.
    for identity in connection.execute(sa.select(_jobs.c.id)).scalars().all():
        chosen = _jobs.c.id == identity
        row = connection.execute(sa.select(_jobs).where(chosen)).one()
        dataset = names.get((row.owner, json.loads(row.spec).get("dataset")))
        values = {
            "dataset_name": dataset,
            "search_labels": _fold("\n".join([row.name, dataset or ""])),
            "search_result": _describe_result(row.summary),
            "model_error": _find_error(row.summary),
        }
        connection.execute(sa.update(_jobs).where(chosen).values(**values))


def _fold(text: str) -> str:
    return normalize("NFKC", text).casefold()


def _find_error(summary: str | None) -> float | None:
    metrics = (json.loads(summary) if summary else {}).get("metrics") or {}
    error = metrics.get("mape")
    return error if isinstance(error, float) and isfinite(error) else None


def _describe_result(summary: str | None) -> str:
    document = {} if summary is None else json.loads(summary)
    entries = [document.get(name) for name in _RESULT]
    texts = [each for entry in entries for each in (entry if isinstance(entry, list) else [entry])]
    return _fold("\n".join(str(text) for text in texts if text))
