"""Initial schema. Written out instead of imported from `tables`, because a migration must never change."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def _job() -> sa.Column[str]:
    return sa.Column("job_id", sa.String(32), nullable=False)


def _with_job(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name=f"fk_{table}_job_id", ondelete="CASCADE")


def upgrade() -> None:
    """Create the tables."""
    _create_jobs()
    _create_progress()
    _create_results()
    _create_datasets()
    _create_keys()


def _create_jobs() -> None:
    op.create_table(
        "jobs",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("kind", sa.String(32), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("spec", sa.Text, nullable=False),
        sa.Column("request_sha256", sa.String(64), nullable=False),
        sa.Column("idempotency_key", sa.String(255)),
        sa.Column("priority", sa.Integer, nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("version", sa.BigInteger, nullable=False),
        sa.Column("attempt", sa.Integer, nullable=False),
        sa.Column("stalled", sa.Integer, nullable=False),
        sa.Column("lease_owner", sa.String(128)),
        sa.Column("lease_epoch", sa.BigInteger, nullable=False),
        sa.Column("lease_until", sa.Float, nullable=False),
        sa.Column("cancel_requested", sa.Boolean, nullable=False),
        sa.Column("progress", sa.Text),
        sa.Column("checkpoint", sa.String(64)),
        sa.Column("summary", sa.Text),
        sa.Column("problem", sa.Text),
        sa.Column("created", sa.Float, nullable=False),
        sa.Column("updated", sa.Float, nullable=False),
        sa.Column("started", sa.Float),
        sa.Column("finished", sa.Float),
        sa.PrimaryKeyConstraint("id", name="pk_jobs"),
        sa.UniqueConstraint("owner", "idempotency_key", name="uq_jobs_owner_idempotency_key"),
    )
    op.create_index("ix_jobs_state_priority_created", "jobs", ["state", "priority", "created"])
    op.create_index("ix_jobs_owner_created_id", "jobs", ["owner", "created", "id"])
    op.create_index("ix_jobs_owner_state_created_id", "jobs", ["owner", "state", "created", "id"])


def _create_progress() -> None:
    op.create_table(
        "events",
        _job(),
        sa.Column("number", sa.BigInteger, nullable=False),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("data", sa.Text, nullable=False),
        sa.Column("at", sa.Float, nullable=False),
        sa.PrimaryKeyConstraint("job_id", "number", name="pk_events"),
        _with_job("events"),
    )
    op.create_table(
        "points",
        _job(),
        sa.Column("generation", sa.Integer, nullable=False),
        sa.Column("evaluations", sa.BigInteger, nullable=False),
        sa.Column("best", sa.Text, nullable=False),
        sa.Column("islands", sa.Text, nullable=False),
        sa.PrimaryKeyConstraint("job_id", "generation", name="pk_points"),
        _with_job("points"),
    )


def _create_results() -> None:
    op.create_table(
        "results",
        _job(),
        sa.Column("document", sa.Text, nullable=False),
        sa.PrimaryKeyConstraint("job_id", name="pk_results"),
        _with_job("results"),
    )
    op.create_table(
        "models",
        _job(),
        sa.Column("rank", sa.Integer, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
        sa.Column("file", sa.Text, nullable=False),
        sa.PrimaryKeyConstraint("job_id", "rank", name="pk_models"),
        _with_job("models"),
    )
    op.create_table(
        "artefacts",
        _job(),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("blob", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("job_id", "name", name="pk_artefacts"),
        _with_job("artefacts"),
    )


def _create_datasets() -> None:
    op.create_table(
        "datasets",
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("id", sa.String(48), nullable=False),
        sa.Column("name", sa.String(255), nullable=False),
        sa.Column("suffix", sa.String(16), nullable=False),
        sa.Column("blob", sa.String(64), nullable=False),
        sa.Column("bytes", sa.BigInteger, nullable=False),
        sa.Column("preview", sa.Text, nullable=False),
        sa.Column("created", sa.Float, nullable=False),
        sa.PrimaryKeyConstraint("owner", "id", name="pk_datasets"),
    )


def _create_keys() -> None:
    op.create_table(
        "keys",
        sa.Column("id", sa.String(16), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("secret_sha256", sa.String(64), nullable=False),
        sa.Column("scopes", sa.Text, nullable=False),
        sa.Column("created", sa.Float, nullable=False),
        sa.Column("expires", sa.Float),
        sa.Column("revoked", sa.Float),
        sa.PrimaryKeyConstraint("id", name="pk_keys"),
        sa.UniqueConstraint("secret_sha256", name="uq_keys_secret_sha256"),
    )
