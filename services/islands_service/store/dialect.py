"""Differences between SQLite and PostgreSQL: the clock of the database, and advisory locks."""

from typing import Any

from sqlalchemy import Connection, Float, func, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class now(FunctionElement[float]):  # noqa: N801 - a function of SQL
    """Seconds since 1970, as the database reads them while it carries out the statement."""

    type = Float()
    inherit_cache = True


@compiles(now, "sqlite")
def _sqlite(_element: now, _compiler: Any, **_: Any) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(now, "postgresql")
def _postgresql(_element: now, _compiler: Any, **_: Any) -> str:
    # Not SQL's own now(), which stands still in a transaction: a group of commits may take a while.
    return "EXTRACT(EPOCH FROM clock_timestamp())::float8"


#: First halves of the names of PostgreSQL's advisory locks: ours among those of other programs.
_MIGRATING = 7_241_563
_COUNTING = 7_241_564


def lock_migration(connection: Connection) -> None:
    """Hold the lock of migrations until the transaction ends."""
    _lock(connection, _MIGRATING, "")


def lock_owner(connection: Connection, owner: str) -> None:
    """Hold the lock of an owner until the transaction ends.

    Without it two transactions that count before they insert would not see each other: quotas would be
    exceeded, and an idempotency key would be used twice.
    """
    _lock(connection, _COUNTING, owner)


def _lock(connection: Connection, purpose: int, name: str) -> None:
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(purpose, func.hashtext(name))))
