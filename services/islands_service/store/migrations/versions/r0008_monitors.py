"""Monitors, and the order of their records in the queue."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Add the table, and the columns and the index of jobs."""
    op.create_table(
        "monitors",
        sa.Column("id", sa.String(32), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("spec", sa.Text, nullable=False),
        sa.Column("priority", sa.Integer, nullable=False),
        sa.Column("version", sa.BigInteger, nullable=False),
        sa.Column("submitted", sa.BigInteger, nullable=False),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("records", sa.BigInteger, nullable=False),
        sa.Column("alarms", sa.BigInteger, nullable=False),
        sa.Column("state", sa.Text),
        sa.Column("document", sa.Text),
        sa.Column("created", sa.Float, nullable=False),
        sa.Column("updated", sa.Float, nullable=False),
        sa.Column("islands_version", sa.String(64)),
        sa.PrimaryKeyConstraint("id", name="pk_monitors"),
    )
    op.create_index("ix_monitors_owner_created_id", "monitors", ["owner", "created", "id"])
    op.add_column("jobs", sa.Column("monitor_id", sa.String(32)))
    op.add_column("jobs", sa.Column("record_number", sa.BigInteger))
    named = sa.text("monitor_id IS NOT NULL")
    op.create_index(
        "ix_jobs_monitor",
        "jobs",
        ["monitor_id", "state", "record_number"],
        sqlite_where=named,
        postgresql_where=named,
    )
