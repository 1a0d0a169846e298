"""Differences between SQLite and PostgreSQL: clock, search in texts, snapshots, upserts, advisory locks."""

from collections.abc import Callable, Mapping
from typing import Any

from sqlalchemy import Connection, Float, Integer, Table, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class now(FunctionElement[float]):  # noqa: N801 - an SQL function
    """Seconds since 1970 by the clock of the database, at the execution of the statement."""

    type = Float()
    inherit_cache = True


@compiles(now, "sqlite")
def _sqlite(_element: now, _compiler: Any, **_: Any) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(now, "postgresql")
def _postgresql(_element: now, _compiler: Any, **_: Any) -> str:
    # SQL's own now() is constant within a transaction, and a group commit may take a while.
    return "EXTRACT(EPOCH FROM clock_timestamp())::float8"


class position(FunctionElement[int]):  # noqa: N801 - an SQL function
    """Position of a text in another one, from 1; 0 if it is absent. LIKE differs between the databases."""

    type = Integer()
    inherit_cache = True


@compiles(position, "sqlite")
def _sqlite_position(element: position, compiler: Any, **arguments: Any) -> str:
    return f"instr({compiler.process(element.clauses, **arguments)})"


@compiles(position, "postgresql")
def _postgresql_position(element: position, compiler: Any, **arguments: Any) -> str:
    return f"strpos({compiler.process(element.clauses, **arguments)})"


#: First statement of a transaction whose statements all see one state, by dialect.
_BEGIN_SNAPSHOT = {
    "postgresql": "SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY",
    "sqlite": "BEGIN",
}


def begin_snapshot(connection: Connection) -> None:
    """Let all statements of a new transaction see the state of the first one."""
    # Readers of SQLite begin no transaction by themselves.
    connection.exec_driver_sql(_BEGIN_SNAPSHOT[connection.dialect.name])


#: First keys of the advisory locks of PostgreSQL, which separate these from the locks of other programs.
_MIGRATION_LOCK = 7_241_563
_OWNER_LOCK = 7_241_564
_CLAIM_LOCK = 7_241_565


_INSERTS: Mapping[str, Callable[[Table], Any]] = {"postgresql": postgresql.insert, "sqlite": sqlite.insert}


def lock_migration(connection: Connection) -> None:
    """Hold the migration lock until the transaction ends."""
    _lock(connection, _MIGRATION_LOCK, "")


def lock_owner(connection: Connection, owner: str) -> None:
    """Hold the lock of an owner until the transaction ends.

    Without it two transactions that count before they insert would not see each other's rows: both could pass
    the quota check, or use the same idempotency key.
    """
    _lock(connection, _OWNER_LOCK, owner)


def lock_claims(connection: Connection) -> None:
    """Hold the lock of claims until the transaction ends.

    Without it two coordinators could serve the same owner in the same turn, or exceed its quotas of
    running jobs and islands. No transaction that holds it waits for another lock for longer than a commit.
    """
    _lock(connection, _CLAIM_LOCK, "")


def upsert(connection: Connection, table: Table, key: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Update the columns of the row with a primary key, or insert the row."""
    statement = _INSERTS[connection.dialect.name](table).values(**key, **values)
    connection.execute(statement.on_conflict_do_update(index_elements=list(key), set_=dict(values)))


def _lock(connection: Connection, purpose: int, name: str) -> None:
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(purpose, func.hashtext(name))))
