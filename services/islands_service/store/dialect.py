"""Differences between SQLite and PostgreSQL: connections, clock, search in texts, upserts and locks."""

import sqlite3
from collections.abc import Callable, Mapping
from time import sleep
from typing import Any

from sqlalchemy import Connection, Engine, Float, Integer, Table, create_engine, event, func, make_url, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError

#: Seconds that SQLite waits for the transaction of another process, and a thread for a connection.
BUSY_TIMEOUT = 30.0

#: Seconds between two attempts to enable write-ahead logging, for which SQLite does not wait.
WAL_RETRY_SECONDS = 0.02

#: Pragmas of every SQLite connection: an acknowledged write is on the disk.
PRAGMAS = ("synchronous=FULL", f"busy_timeout={int(1000 * BUSY_TIMEOUT)}", "foreign_keys=ON")

#: libpq options unless the URL sets them: a lost PostgreSQL server is detected within seconds.
LIBPQ_OPTIONS = {
    "connect_timeout": 5,
    "keepalives_idle": 4,
    "keepalives_interval": 2,
    "keepalives_count": 2,
    "tcp_user_timeout": 8_000,
}

#: Settings of every PostgreSQL session: a process that is stopped within a transaction loses its locks.
SETTINGS = ("idle_in_transaction_session_timeout = '10s'",)


def make_engine(url: str) -> Engine:
    """Return an engine for a URL.

    A transaction that writes must set the execution option ``writes``, and one with statements that may take
    minutes the option ``patient``.

    Raises
    ------
    SettingsError
        The database is one of PostgreSQL, but the extra ``cluster`` is not installed.
    """
    return (_make_sqlite_engine if url.startswith("sqlite") else _make_postgresql_engine)(url)


def _make_sqlite_engine(url: str) -> Engine:
    # No timeout until the pragma sets one: `_enable_wal` retries by itself.
    engine = create_engine(
        url, connect_args={"timeout": 0, "check_same_thread": False}, pool_size=10, max_overflow=40
    )

    @event.listens_for(engine, "connect")
    def _configure(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # transactions begin explicitly
        _enable_wal(connection)
        for pragma in PRAGMAS:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        # Take the write lock at the beginning: an upgrade from a read transaction may fail on stale data.
        # Readers begin no transaction, so that each statement has its own snapshot, as with READ COMMITTED in
        # PostgreSQL: beginning and ending a transaction takes as long as reading a job.
        if connection.get_execution_options().get("writes", False):
            connection.exec_driver_sql("BEGIN IMMEDIATE")

    return engine


def _enable_wal(connection: sqlite3.Connection) -> None:
    """Enable write-ahead logging, so that readers and writers do not wait for each other.

    If several connections switch a new file at once, SQLite fails all but one instead of waiting.
    """
    for left in reversed(range(int(BUSY_TIMEOUT / WAL_RETRY_SECONDS))):
        try:
            connection.execute("PRAGMA journal_mode=WAL")
        except sqlite3.OperationalError as error:
            if not error.sqlite_errorname.startswith("SQLITE_BUSY") or left == 0:
                raise
            sleep(WAL_RETRY_SECONDS)
        else:
            return


def _make_postgresql_engine(url: str) -> Engine:
    # An optional dependency, which SQLite does not need.
    try:
        from islands_service.store.timed_connection import TimedConnection  # noqa: PLC0415
    except ImportError as error:
        raise SettingsError(describe_missing_extra("a database of PostgreSQL", "cluster")) from error

    given = make_url(url).query
    engine = create_engine(
        url,
        connect_args={name: value for name, value in LIBPQ_OPTIONS.items() if name not in given},
        isolation_level="READ COMMITTED",
        pool_size=10,
        max_overflow=10,
        pool_pre_ping=True,
        pool_timeout=BUSY_TIMEOUT,
    )

    @event.listens_for(engine, "connect")
    def _configure(connection: Any, _record: Any) -> None:
        for setting in SETTINGS:
            connection.execute(f"SET {setting}")
        connection.commit()

    @event.listens_for(engine, "do_connect")
    def _connect(_dialect: Any, _record: Any, arguments: Any, options: Any) -> Any:
        return TimedConnection.connect(*arguments, **options)

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        driver = connection.connection.driver_connection
        assert isinstance(driver, TimedConnection)
        driver.patient = connection.get_execution_options().get("patient", False)

    return engine


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
