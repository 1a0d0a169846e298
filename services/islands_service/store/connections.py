"""Connections to a database: what each is told before it is used, so that what it acknowledges is durable."""

import sqlite3
from time import sleep
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url

#: Seconds that SQLite waits for another process's transaction, and that a thread waits for a connection.
PATIENCE = 30.0

#: Seconds between two tries where SQLite does not wait by itself.
PAUSE = 0.02

#: What a connection to SQLite is told: an acknowledged write is on the disk.
PRAGMAS = ("synchronous=FULL", f"busy_timeout={int(1000 * PATIENCE)}", "foreign_keys=ON")

#: What libpq is told unless the URL says otherwise: a PostgreSQL that is gone is noticed within seconds.
CONNECTING = {
    "connect_timeout": 5,
    "keepalives_idle": 4,
    "keepalives_interval": 2,
    "keepalives_count": 2,
    "tcp_user_timeout": 8_000,
}

#: What a connection to PostgreSQL is told: a process that stands still lets go of the jobs it was writing.
SETTINGS = ("idle_in_transaction_session_timeout = '10s'",)


def make_engine(url: str) -> Engine:
    """Return what connects to a database. Whoever will write says so by the execution option ``writes``."""
    return (_sqlite if url.startswith("sqlite") else _postgresql)(url)


def _sqlite(url: str) -> Engine:
    # It does not wait by itself until it is told to, below: `_write_ahead` does that.
    engine = create_engine(
        url, connect_args={"timeout": 0, "check_same_thread": False}, pool_size=10, max_overflow=40
    )

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # we say ourselves when a transaction begins
        _write_ahead(connection)
        for pragma in PRAGMAS:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begun(connection: Connection) -> None:
        # Who will write says so at once: a reader that turns writer may find that it has read too early.
        # For readers each statement is one by itself, as with PostgreSQL: to begin and to end one takes as
        # long as to look at a job.
        if connection.get_execution_options().get("writes", False):
            connection.exec_driver_sql("BEGIN IMMEDIATE")

    return engine


def _write_ahead(connection: sqlite3.Connection) -> None:
    """Have SQLite keep a log that it writes ahead: readers do not wait for writers, nor writers for readers.

    Of several that turn a new file to it at once SQLite lets one through, and never has the others wait.
    """
    for left in reversed(range(int(PATIENCE / PAUSE))):
        try:
            connection.execute("PRAGMA journal_mode=WAL")
        except sqlite3.OperationalError as error:
            if not error.sqlite_errorname.startswith("SQLITE_BUSY") or left == 0:
                raise
            sleep(PAUSE)
        else:
            return


def _postgresql(url: str) -> Engine:
    said = make_url(url).query
    engine = create_engine(
        url,
        connect_args={name: value for name, value in CONNECTING.items() if name not in said},
        isolation_level="READ COMMITTED",
        pool_size=10,
        max_overflow=10,
        pool_pre_ping=True,
        pool_timeout=PATIENCE,
    )

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: Any) -> None:
        for setting in SETTINGS:
            connection.execute(f"SET {setting}")
        connection.commit()

    return engine
