"""Versions, retries, kept data sets, audit trail, keys of deleted jobs.

New columns may be omitted, so that running processes of the previous release can still write rows.
"""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add the columns and tables."""
    for name in ("islands_version", "checkpoint_version", "result_version"):
        op.add_column("jobs", sa.Column(name, sa.String(64)))
    op.add_column("jobs", sa.Column("not_before", sa.Float, nullable=False, server_default=sa.text("0")))
    op.add_column("jobs", sa.Column("declined", sa.Text, nullable=False, server_default=""))
    op.drop_index("ix_jobs_state_priority_created", "jobs")
    op.create_index("ix_jobs_queue", "jobs", ["state", sa.text("priority DESC"), "created", "id"])
    op.add_column("datasets", sa.Column("summary", sa.Text))
    op.add_column("datasets", sa.Column("deleted", sa.Float))
    op.create_table(
        "retired_keys",
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("idempotency_key", sa.String(255), nullable=False),
        sa.Column("job_id", sa.String(32), nullable=False),
        sa.Column("request_sha256", sa.String(64), nullable=False),
        sa.Column("finished", sa.Float, nullable=False),
        sa.PrimaryKeyConstraint("owner", "idempotency_key", name="pk_retired_keys"),
    )
    op.create_table(
        "audit",
        sa.Column("number", sa.BigInteger().with_variant(sa.Integer, "sqlite"), nullable=False),
        sa.Column("at", sa.Float, nullable=False),
        sa.Column("action", sa.String(32), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("subject", sa.String(64), nullable=False),
        sa.Column("key_id", sa.String(16)),
        sa.Column("address", sa.String(64), nullable=False),
        sa.PrimaryKeyConstraint("number", name="pk_audit"),
    )
    op.create_index("ix_audit_at", "audit", ["at"])
    op.create_index("ix_audit_owner_at", "audit", ["owner", "at"])
