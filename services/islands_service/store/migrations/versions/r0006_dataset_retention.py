"""Retention of data sets."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Add the columns."""
    op.add_column("datasets", sa.Column("idle_since", sa.Float))
    op.add_column("owners", sa.Column("dataset_retention", sa.BigInteger))
