"""Schema of the first release. Written out, not imported from `tables`: a migration must never change."""

import sqlalchemy as sa
from alembic import op

revision = "0.2.0"
down_revision = None

_metadata = sa.MetaData(
    naming_convention={
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)


def _text(
    name: str, length: int, nullable: bool = False, primary_key: bool = False, unique: bool | None = None
) -> sa.Column[str]:
    return sa.Column(name, sa.String(length), nullable=nullable, primary_key=primary_key, unique=unique)


def _job() -> sa.Column[str]:
    job = sa.ForeignKey("jobs.id", ondelete="CASCADE")
    return sa.Column("job_id", sa.String(32), job, primary_key=True)


sa.Table(
    "jobs",
    _metadata,
    _text("id", 32, primary_key=True),
    _text("owner", 64),
    _text("kind", 32),
    _text("name", 200),
    sa.Column("spec", sa.Text, nullable=False),
    _text("request_sha256", 64),
    _text("idempotency_key", 255, nullable=True),
    sa.Column("priority", sa.Integer, nullable=False),
    _text("state", 16),
    sa.Column("version", sa.BigInteger, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False),
    sa.Column("stalled", sa.Integer, nullable=False),
    _text("lease_owner", 128, nullable=True),
    sa.Column("lease_epoch", sa.BigInteger, nullable=False),
    sa.Column("lease_until", sa.Float, nullable=False),
    sa.Column("cancel_requested", sa.Boolean, nullable=False),
    sa.Column("stop_requested", sa.Boolean, nullable=False, server_default=sa.false()),
    sa.Column("progress", sa.Text),
    _text("checkpoint", 64, nullable=True),
    sa.Column("summary", sa.Text),
    sa.Column("problem", sa.Text),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("updated", sa.Float, nullable=False),
    sa.Column("started", sa.Float),
    sa.Column("finished", sa.Float),
    _text("islands_version", 64, nullable=True),
    _text("checkpoint_version", 64, nullable=True),
    _text("result_version", 64, nullable=True),
    sa.Column("not_before", sa.Float, nullable=False, server_default=sa.text("0")),
    sa.Column("declined", sa.Text, nullable=False, server_default=""),
    sa.Column("run_seconds", sa.Float, nullable=False, server_default=sa.text("0")),
    sa.Column("max_run_seconds", sa.BigInteger),
    sa.Column("islands", sa.Integer, nullable=False, server_default=sa.text("1")),
    _text("monitor_id", 32, nullable=True),
    sa.Column("record_number", sa.BigInteger),
    sa.Column("tags", sa.Text, nullable=False, server_default=""),
    _text("dataset_name", 255, nullable=True),
    sa.Column("search_labels", sa.Text, nullable=False, server_default=""),
    sa.Column("search_result", sa.Text, nullable=False, server_default=""),
    sa.Column("model_error", sa.Float),
    sa.UniqueConstraint("owner", "idempotency_key"),
)

sa.Table(
    "events",
    _metadata,
    _job(),
    sa.Column("number", sa.BigInteger, primary_key=True),
    _text("kind", 16),
    sa.Column("data", sa.Text, nullable=False),
    sa.Column("at", sa.Float, nullable=False),
)

sa.Table(
    "points",
    _metadata,
    _job(),
    sa.Column("generation", sa.Integer, primary_key=True),
    sa.Column("evaluations", sa.BigInteger, nullable=False),
    sa.Column("best", sa.Text, nullable=False),
    sa.Column("islands", sa.Text, nullable=False),
)

sa.Table("results", _metadata, _job(), sa.Column("document", sa.Text, nullable=False))

sa.Table(
    "models",
    _metadata,
    _job(),
    sa.Column("rank", sa.Integer, primary_key=True),
    sa.Column("document", sa.Text, nullable=False),
    sa.Column("file", sa.Text, nullable=False),
)

sa.Table("artefacts", _metadata, _job(), _text("name", 64, primary_key=True), _text("blob", 64))

sa.Table(
    "datasets",
    _metadata,
    _text("owner", 64, primary_key=True),
    _text("id", 48, primary_key=True),
    _text("name", 255),
    _text("suffix", 16),
    _text("blob", 64),
    sa.Column("bytes", sa.BigInteger, nullable=False),
    sa.Column("preview", sa.Text, nullable=False),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("summary", sa.Text),
    sa.Column("source", sa.Text),
    sa.Column("idle_since", sa.Float),
    sa.Column("deleted", sa.Float),
)

sa.Table(
    "retired_keys",
    _metadata,
    _text("owner", 64, primary_key=True),
    _text("idempotency_key", 255, primary_key=True),
    _text("job_id", 32),
    _text("request_sha256", 64),
    sa.Column("finished", sa.Float, nullable=False),
)

sa.Table(
    "keys",
    _metadata,
    _text("id", 16, primary_key=True),
    _text("owner", 64),
    _text("name", 200),
    _text("secret_sha256", 64, unique=True),
    sa.Column("scopes", sa.Text, nullable=False),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("expires", sa.Float),
    sa.Column("revoked", sa.Float),
)

sa.Table(
    "monitors",
    _metadata,
    _text("id", 32, primary_key=True),
    _text("owner", 64),
    _text("name", 200),
    sa.Column("spec", sa.Text, nullable=False),
    sa.Column("priority", sa.Integer, nullable=False),
    sa.Column("version", sa.BigInteger, nullable=False),
    sa.Column("submitted", sa.BigInteger, nullable=False),
    _text("status", 16),
    sa.Column("records", sa.BigInteger, nullable=False),
    sa.Column("alarms", sa.BigInteger, nullable=False),
    sa.Column("state", sa.Text),
    sa.Column("document", sa.Text),
    sa.Column("start", sa.BigInteger, nullable=False, server_default=sa.text("0")),
    sa.Column("last_alarm", sa.Text),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("updated", sa.Float, nullable=False),
    _text("islands_version", 64, nullable=True),
)

sa.Table(
    "monitor_records",
    _metadata,
    sa.Column(
        "monitor_id", sa.String(32), sa.ForeignKey("monitors.id", ondelete="CASCADE"), primary_key=True
    ),
    sa.Column("is_rejected", sa.Boolean, primary_key=True),
    sa.Column("place", sa.BigInteger, primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    _text("sha256", 64),
    sa.Column("state", sa.Text, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
)

sa.Table(
    "webhooks",
    _metadata,
    _text("id", 32, primary_key=True),
    _text("owner", 64),
    sa.Column("url", sa.Text, nullable=False),
    sa.Column("events", sa.Text, nullable=False),
    _text("secret", 64),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("busy_until", sa.Float, nullable=False, server_default=sa.text("0")),
)

sa.Table(
    "deliveries",
    _metadata,
    _text("id", 32, primary_key=True),
    sa.Column("webhook_id", sa.String(32), sa.ForeignKey("webhooks.id", ondelete="CASCADE"), nullable=False),
    _text("event", 32),
    _text("job_id", 32),
    sa.Column("body", sa.Text, nullable=False),
    sa.Column("created", sa.Float, nullable=False),
    sa.Column("attempts", sa.Integer, nullable=False),
    sa.Column("next_at", sa.Float),
    sa.Column("attempted", sa.Float),
    sa.Column("delivered", sa.Float),
    sa.Column("status", sa.Integer),
    sa.Column("error", sa.Text),
)

sa.Table(
    "owners",
    _metadata,
    _text("name", 64, primary_key=True),
    sa.Column("weight", sa.Integer, nullable=False),
    sa.Column("virtual_time", sa.BigInteger),
    sa.Column("max_active", sa.BigInteger),
    sa.Column("max_running", sa.BigInteger),
    sa.Column("max_islands", sa.BigInteger),
    sa.Column("max_run_seconds", sa.BigInteger),
    sa.Column("max_uploads", sa.BigInteger),
    sa.Column("max_stored", sa.BigInteger),
    sa.Column("max_streams", sa.BigInteger),
    sa.Column("max_drawings", sa.BigInteger),
    sa.Column("dataset_retention", sa.BigInteger),
)

sa.Table(
    "audit",
    _metadata,
    sa.Column("number", sa.BigInteger().with_variant(sa.Integer, "sqlite"), primary_key=True),
    sa.Column("at", sa.Float, nullable=False),
    _text("action", 32),
    _text("owner", 64),
    _text("subject", 64),
    _text("key_id", 16, nullable=True),
    _text("address", 64),
    sa.Column("details", sa.Text),
)


#: Tables and columns of the indexes with default names. The order of their creation, and of the others after
#: them, decides which one SQLite takes for a query that several suit alike.
_INDEXES = (
    ("jobs", "owner", "created", "id"),
    ("jobs", "owner", "state", "created", "id"),
    ("audit", "at"),
    ("audit", "owner", "at"),
    ("owners", "virtual_time"),
    ("webhooks", "owner"),
    ("deliveries", "webhook_id", "next_at"),
    ("deliveries", "webhook_id", "created"),
    ("monitors", "owner", "created", "id"),
    ("monitor_records", "monitor_id", "sha256"),
)


def upgrade() -> None:
    """Create the tables and the indexes."""
    _metadata.create_all(op.get_bind(), checkfirst=False)
    for table, *columns in _INDEXES:
        op.create_index(f"ix_{table}_{'_'.join(columns)}", table, columns)
    op.create_index(
        "ix_jobs_queue", "jobs", ["state", "owner", sa.text("priority DESC"), "created", "id", "islands"]
    )
    _create_partial_index(
        "ix_jobs_monitor", ["monitor_id", "state", "record_number"], "monitor_id IS NOT NULL"
    )
    _create_partial_index("ix_jobs_model_error", ["owner", "model_error", "id"], "model_error IS NOT NULL")


def _create_partial_index(name: str, columns: list[str], condition: str) -> None:
    where = sa.text(condition)
    op.create_index(name, "jobs", columns, sqlite_where=where, postgresql_where=where)
