"""`Database`: translated errors, timeouts and retries."""

import socket
import sqlite3
import threading
import time
from contextlib import closing

import pytest
from sqlalchemy import event, text
from sqlalchemy.exc import DBAPIError, IntegrityError, ProgrammingError

from islands_service.store import Store, dialect
from islands_service.store.database import (
    CommitUnknownError,
    Database,
    DatabaseDamagedError,
    StorageFullError,
    StoreCollisionError,
    StoreError,
    StoreUnavailableError,
)
from support.databases import emptied
from support.stores import at_once

RAISE = "DO $$ BEGIN RAISE EXCEPTION 'in this test' USING ERRCODE = '{}'; END $$"

MEANS = {
    "53100": StorageFullError,  # disk full
    "08006": StoreUnavailableError,  # connection failure
    "57P01": StoreUnavailableError,  # admin shutdown
    "57P03": StoreUnavailableError,  # cannot connect now
    "53300": StoreUnavailableError,  # too many connections
    "25006": StoreUnavailableError,  # read-only transaction: the server is a standby now
    "40001": StoreCollisionError,  # serialization failure
    "40P01": StoreCollisionError,  # deadlock
    "23505": IntegrityError,  # unique violation: an error of the operation alone
    "42P01": ProgrammingError,  # undefined table
}


@pytest.fixture
def sqlite(prepared_sqlite, tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'islands.db'}")
    yield database
    database.close()


@pytest.fixture
def postgresql(prepared_postgres):
    database = Database(emptied(prepared_postgres))
    yield database
    database.close()


def executing(statement):
    return lambda connection: connection.execute(text(statement))


@pytest.mark.parametrize("state", MEANS)
def test_postgresql_errors_are_translated(postgresql, state):
    with pytest.raises((StoreError, DBAPIError)) as raised:
        postgresql.write(executing(RAISE.format(state)))
    assert type(raised.value) is MEANS[state]
    assert "in this test" in str(raised.value)
    if isinstance(raised.value, StoreError):
        assert isinstance(raised.value.__cause__, DBAPIError)
        assert "nothing was written" in str(raised.value)
    postgresql.write(executing("SELECT 1"))


def test_errors_of_a_read_are_translated(postgresql):
    with pytest.raises(StoreUnavailableError), postgresql.read() as connection:
        connection.execute(text(RAISE.format("57P01")))


def test_collision_is_retried_a_limited_number_of_times(postgresql):
    tries = []

    def collides(connection):
        tries.append(1)
        connection.execute(text(RAISE.format("40P01")))

    with pytest.raises(StoreCollisionError, match="try again"):
        postgresql.write(collides)
    assert 2 <= len(tries) <= 10


def ending(connection):
    """Make the server end the connection, as an administrator or a crash does."""
    return connection.exec_driver_sql("SELECT pg_terminate_backend(pg_backend_pid())")


def test_connection_lost_before_the_commit_means_nothing_was_written(postgresql):
    with pytest.raises(StoreUnavailableError, match="nothing was written") as raised:
        postgresql.write(ending)
    assert not isinstance(raised.value, CommitUnknownError)
    postgresql.write(executing("SELECT 1"))


def test_connection_lost_during_the_commit_means_unknown_outcome(postgresql):
    event.listen(postgresql.engine, "commit", ending, once=True)
    with pytest.raises(CommitUnknownError, match="unknown whether the transaction was written") as raised:
        postgresql.write(executing("SELECT 1"))
    assert "nothing was written" not in str(raised.value)
    postgresql.write(executing("SELECT 1"))


def test_locked_file_raises_an_error_after_the_timeout(sqlite, tmp_path, monkeypatch):
    sqlite.write(executing("SELECT 1"))
    monkeypatch.setattr(dialect, "PRAGMAS", ("busy_timeout=200",))
    hasty = Database(sqlite.url)
    with closing(sqlite3.connect(tmp_path / "islands.db", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        began = time.monotonic()
        with pytest.raises(StoreUnavailableError, match="locked"):
            hasty.write(executing("SELECT 1"))
        assert time.monotonic() - began > 0.15
        with hasty.read() as connection:
            connection.execute(text("SELECT 1"))
        other.execute("COMMIT")
        hasty.write(executing("SELECT 1"))
    hasty.close()


def test_a_file_that_is_no_database_is_not_written(tmp_path):
    path = tmp_path / "islands.db"
    path.write_bytes(b"a record, perhaps" * 100)
    database = Database(f"sqlite:///{path}")
    with pytest.raises(DatabaseDamagedError, match=r"not a database.*restore a backup"), database.read():
        pass
    database.close()
    assert path.read_bytes() == b"a record, perhaps" * 100


def test_missing_folder_raises_an_error(tmp_path):
    with pytest.raises(StoreUnavailableError, match="unable to open"):
        Store(f"sqlite:///{tmp_path / 'nowhere' / 'islands.db'}")


def test_sqlite_connections_are_durable_and_enforce_foreign_keys(sqlite):
    def asked(name):
        with sqlite.read() as connection:
            return connection.execute(text(f"PRAGMA {name}")).scalar()

    names = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
    found = at_once([lambda: [asked(name) for name in names]] * 8)
    assert found == [["wal", 2, 1, 1000 * dialect.BUSY_TIMEOUT]] * 8


@pytest.mark.ci
def test_server_that_never_answers_raises_an_error_after_a_timeout(monkeypatch):
    """For example a stopped server, or one behind a firewall."""
    monkeypatch.setitem(dialect.LIBPQ_OPTIONS, "connect_timeout", 2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        database = Database(f"postgresql+psycopg://user@127.0.0.1:{silent.getsockname()[1]}/none")
        began = time.monotonic()
        with pytest.raises(StoreUnavailableError, match="timeout"):
            database.write(executing("SELECT 1"))
        assert time.monotonic() - began < 25
        database.close()


def test_writer_that_cannot_start_blocks_no_later_write(sqlite, monkeypatch):
    """With too many threads the first write fails, and the next one tries again."""
    start, starts = threading.Thread.start, []

    def refused_once(thread):
        starts.append(thread.name)
        if len(starts) == 1:
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", refused_once)
    with pytest.raises(RuntimeError, match="can't start new thread"):
        sqlite.write(executing("SELECT 1"))
    monkeypatch.undo()
    (answer,) = at_once([lambda: sqlite.write(executing("SELECT 1")) is not None])
    assert answer is True
