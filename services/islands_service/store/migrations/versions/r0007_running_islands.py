"""Quota of running islands.

Jobs of earlier revisions get the number of islands that their specification states. A running process of the
previous release omits the column, so its jobs count one island, and does not know the quota.
"""

import json

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Add the columns, count the islands of unfinished jobs, and replace the index of the queue."""
    op.add_column("jobs", sa.Column("islands", sa.Integer, nullable=False, server_default=sa.text("1")))
    op.add_column("owners", sa.Column("max_islands", sa.BigInteger))
    jobs = sa.table("jobs", sa.column("id"), sa.column("state"), sa.column("spec"), sa.column("islands"))
    connection = op.get_bind()
    stated = sa.select(jobs.c.id, jobs.c.spec).where(
        jobs.c.state != "succeeded", jobs.c.spec.like('%"islands"%')
    )
    for job, spec in connection.execute(stated).all():
        # Every preset has one island.
        islands = (json.loads(spec).get("settings") or {}).get("islands") or 1
        connection.execute(sa.update(jobs).where(jobs.c.id == job).values(islands=islands))
    op.drop_index("ix_jobs_queue", "jobs")
    op.create_index(
        "ix_jobs_queue", "jobs", ["state", "owner", sa.text("priority DESC"), "created", "id", "islands"]
    )
