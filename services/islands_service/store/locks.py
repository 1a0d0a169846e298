"""What one transaction at a time may do. SQLite has one writer anyway; PostgreSQL has to be told."""

from sqlalchemy import Connection, func, select

#: First halves of the names of PostgreSQL's advisory locks: ours among those of other programs.
_MIGRATING, _COUNTING = 7_241_563, 7_241_564


def migrating(connection: Connection) -> None:
    """Wait until nobody else migrates the database; keep others waiting until the transaction ends."""
    _lock(connection, _MIGRATING, "")


def counting(connection: Connection, owner: str) -> None:
    """Wait until nobody else adds to what an owner has; keep others waiting until the transaction ends.

    Who counts before it adds would else count without what another transaction is adding just now: quotas
    would be exceeded, and an idempotency key be found free twice.
    """
    _lock(connection, _COUNTING, owner)


def _lock(connection: Connection, purpose: int, name: str) -> None:
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(purpose, func.hashtext(name))))
