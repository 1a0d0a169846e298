"""Weights and quotas of owners, a queue in the order of owners, details of audit entries."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Add the table and the column, and replace the index of the queue."""
    op.create_table(
        "owners",
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("weight", sa.Integer, nullable=False),
        sa.Column("virtual_time", sa.BigInteger),
        sa.Column("max_active", sa.BigInteger),
        sa.Column("max_running", sa.BigInteger),
        sa.Column("max_uploads", sa.BigInteger),
        sa.Column("max_stored", sa.BigInteger),
        sa.Column("max_streams", sa.BigInteger),
        sa.Column("max_drawings", sa.BigInteger),
        sa.PrimaryKeyConstraint("name", name="pk_owners"),
    )
    op.create_index("ix_owners_virtual_time", "owners", ["virtual_time"])
    op.drop_index("ix_jobs_queue", "jobs")
    op.create_index("ix_jobs_queue", "jobs", ["state", "owner", sa.text("priority DESC"), "created", "id"])
    op.add_column("audit", sa.Column("details", sa.Text))
