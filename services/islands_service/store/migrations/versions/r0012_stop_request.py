"""Request to end the search of a job early, with its best models.

A running process of the previous release does not know the request: the job runs to its end.
"""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"


def upgrade() -> None:
    """Add the column."""
    op.add_column("jobs", sa.Column("stop_requested", sa.Boolean, nullable=False, server_default=sa.false()))
