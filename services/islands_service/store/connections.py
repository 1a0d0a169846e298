"""Connections to a database, configured so that an acknowledged write is durable."""

import sqlite3
from time import sleep
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url

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
    return (_sqlite if url.startswith("sqlite") else _postgresql)(url)


def _sqlite(url: str) -> Engine:
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


def _postgresql(url: str) -> Engine:
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
