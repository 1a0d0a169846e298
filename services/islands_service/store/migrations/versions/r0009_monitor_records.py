"""Records of monitors in rows: a monitor stored all its records again with each of them.

A running process of the previous release cannot read the states from then on, and leaves the records to
processes of this one.
"""

import json
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"

_HEAD_SCHEMA = "islands.monitor-head/1"

_monitors = sa.table("monitors", *map(sa.column, ("id", "state", "document", "start", "last_alarm")))


def upgrade() -> None:
    """Add the table and the columns, and move the records of monitors."""
    table = op.create_table(
        "monitor_records",
        sa.Column("monitor_id", sa.String(32), nullable=False),
        sa.Column("is_rejected", sa.Boolean, nullable=False),
        sa.Column("place", sa.BigInteger, nullable=False),
        sa.Column("name", sa.Text, nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("state", sa.Text, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
        sa.ForeignKeyConstraint(
            ["monitor_id"], ["monitors.id"], "fk_monitor_records_monitor_id_monitors", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("monitor_id", "is_rejected", "place", name="pk_monitor_records"),
    )
    op.create_index("ix_monitor_records_monitor_id_sha256", "monitor_records", ["monitor_id", "sha256"])
    start = sa.Column("start", sa.BigInteger, nullable=False, server_default=sa.text("0"))
    op.add_column("monitors", start)
    op.add_column("monitors", sa.Column("last_alarm", sa.Text))
    connection = op.get_bind()
    known = sa.select(_monitors.c.id).where(_monitors.c.state.is_not(None))
    for monitor in connection.execute(known).scalars().all():
        _move_records(connection, table, monitor)


def _move_records(connection: sa.Connection, table: sa.Table, monitor: str) -> None:
    """Move the records of a monitor from its row to rows of the table."""
    chosen = _monitors.c.id == monitor
    row = connection.execute(sa.select(_monitors.c.state, _monitors.c.document).where(chosen)).one()
    head, document = json.loads(row.state), json.loads(row.document)
    # Replaced in their places: the order of the names is part of a state.
    analysed, head["state"]["records"] = head["state"]["records"], []
    rejected, head["rejected"] = head["rejected"], []
    entries = [
        *_make_rows(monitor, False, analysed, document.pop("records")),
        *_make_rows(monitor, True, rejected, document.pop("rejected")),
    ]
    if entries:
        connection.execute(table.insert(), entries)
    changes = {
        "state": json.dumps({**head, "schema": _HEAD_SCHEMA}),
        "document": json.dumps(document),
        "start": head["state"]["start"],
        "last_alarm": json.dumps(document["alarms"][-1]) if document["alarms"] else None,
    }
    connection.execute(sa.update(_monitors).where(chosen).values(**changes))


def _make_rows(
    monitor: str, is_rejected: bool, states: list[dict[str, Any]], documents: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    return [
        {
            "monitor_id": monitor,
            "is_rejected": is_rejected,
            "place": place,
            "name": state["name"],
            "sha256": state["sha256"],
            "state": json.dumps(state),
            "document": json.dumps({"index": place, **document}),
        }
        for place, (state, document) in enumerate(zip(states, documents, strict=True))
    ]
