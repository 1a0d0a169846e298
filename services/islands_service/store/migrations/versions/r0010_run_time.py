"""Limit of the run time of jobs.

The run time of unfinished jobs begins with this revision. A running process of the previous release neither
counts it nor knows the limit.
"""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"


def upgrade() -> None:
    """Add the columns."""
    op.add_column("jobs", sa.Column("run_seconds", sa.Float, nullable=False, server_default=sa.text("0")))
    op.add_column("jobs", sa.Column("max_run_seconds", sa.BigInteger))
    op.add_column("owners", sa.Column("max_run_seconds", sa.BigInteger))
