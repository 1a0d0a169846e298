"""Database: what a driver raises is told as what it means, and what it means for whoever asked."""

import socket
import sqlite3
import threading
import time
from contextlib import closing
from functools import partial

import pytest
from sqlalchemy import event, text
from sqlalchemy.exc import DBAPIError, IntegrityError, ProgrammingError

from islands_service.store import Store, connections
from islands_service.store.database import (
    CommitUnknownError,
    Database,
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
    "25006": StoreUnavailableError,  # read-only transaction: this one is another one's copy now
    "40001": StoreCollisionError,  # serialization failure
    "40P01": StoreCollisionError,  # deadlock
    "23505": IntegrityError,  # unique violation: somebody's mistake, and nobody's but its own
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
def test_what_postgresql_raises_is_told_as_what_it_means(postgresql, state):
    with pytest.raises((StoreError, DBAPIError)) as raised:
        postgresql.write(executing(RAISE.format(state)))
    assert type(raised.value) is MEANS[state]
    assert "in this test" in str(raised.value)
    if isinstance(raised.value, StoreError):
        assert isinstance(raised.value.__cause__, DBAPIError)
        assert "nothing was written" in str(raised.value)
    postgresql.write(executing("SELECT 1"))


def test_a_read_is_told_alike(postgresql):
    with pytest.raises(StoreUnavailableError), postgresql.read() as connection:
        connection.execute(text(RAISE.format("57P01")))


def test_a_collision_is_tried_again_and_in_the_end_given_up(postgresql):
    tries = []

    def collides(connection):
        tries.append(1)
        connection.execute(text(RAISE.format("40P01")))

    with pytest.raises(StoreCollisionError, match="try again"):
        postgresql.write(collides)
    assert 2 <= len(tries) <= 10


def test_a_collision_that_is_over_is_not_seen(postgresql):
    tries = []

    def collides_once(connection):
        tries.append(1)
        if len(tries) == 1:
            connection.execute(text(RAISE.format("40001")))
        return len(tries)

    assert postgresql.write(collides_once) == 2


def ending(connection):
    """Have the server end a connection, as an administrator or a crash does."""
    return connection.exec_driver_sql("SELECT pg_terminate_backend(pg_backend_pid())")


def test_who_is_cut_off_before_the_commit_is_told_that_nothing_was_written(postgresql):
    with pytest.raises(StoreUnavailableError, match="nothing was written") as raised:
        postgresql.write(ending)
    assert not isinstance(raised.value, CommitUnknownError)
    postgresql.write(executing("SELECT 1"))


def test_who_is_cut_off_during_the_commit_is_not_told_that_nothing_was_written(postgresql):
    event.listen(postgresql.engine, "commit", ending, once=True)
    with pytest.raises(CommitUnknownError, match="nobody knows whether it was written") as raised:
        postgresql.write(executing("SELECT 1"))
    assert "nothing was written" not in str(raised.value)
    postgresql.write(executing("SELECT 1"))


def test_a_statement_that_is_wrong_is_not_the_databases_fault(sqlite):
    with pytest.raises(DBAPIError, match="nowhere"):
        sqlite.write(executing("SELECT * FROM nowhere"))
    with pytest.raises(DBAPIError, match="nowhere"), sqlite.read() as connection:
        connection.execute(text("SELECT * FROM nowhere"))


def test_a_file_that_is_locked_is_waited_for_and_then_told(sqlite, tmp_path, monkeypatch):
    sqlite.write(executing("SELECT 1"))
    monkeypatch.setattr(connections, "PRAGMAS", ("busy_timeout=200",))
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


def test_a_new_file_that_is_locked_is_waited_for_and_then_told(tmp_path, monkeypatch):
    """Whoever turns it to a log that is written ahead is not made to wait by SQLite."""
    monkeypatch.setattr(connections, "PATIENCE", 0.4)
    database = Database(f"sqlite:///{tmp_path / 'islands.db'}")
    with closing(sqlite3.connect(tmp_path / "islands.db", isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        other.execute("CREATE TABLE taken (a)")
        began = time.monotonic()
        with pytest.raises(StoreUnavailableError, match="locked"):
            database.write(executing("SELECT 1"))
        assert 0.3 < time.monotonic() - began < 25
        other.execute("COMMIT")
    database.write(executing("SELECT * FROM taken"))
    database.close()


def test_a_file_that_is_no_database_is_not_written(tmp_path):
    path = tmp_path / "islands.db"
    path.write_bytes(b"a record, perhaps" * 100)
    database = Database(f"sqlite:///{path}")
    with pytest.raises(DBAPIError, match="not a database"), database.read():
        pass
    database.close()
    assert path.read_bytes() == b"a record, perhaps" * 100


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(StoreUnavailableError, match="unable to open"):
        Store(f"sqlite:///{tmp_path / 'nowhere' / 'islands.db'}")


def test_every_connection_to_sqlite_waits_for_the_disk_and_holds_to_foreign_keys(sqlite):
    def asked(name):
        with sqlite.read() as connection:
            return connection.execute(text(f"PRAGMA {name}")).scalar()

    names = ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
    found = at_once([lambda: [asked(name) for name in names]] * 8)
    assert found == [["wal", 2, 1, 1000 * connections.PATIENCE]] * 8


def test_a_connection_to_postgresql_notices_an_end_and_lets_go_when_it_stands_still(postgresql):
    with postgresql.read() as connection:
        info = connection.connection.dbapi_connection.info
        assert (
            info.get_parameters().items()
            >= {name: str(value) for name, value in connections.CONNECTING.items()}.items()
        )
        timeout = connection.execute(text("SHOW idle_in_transaction_session_timeout")).scalar()
        level = connection.execute(text("SHOW transaction_isolation")).scalar()
    assert (timeout, level) == ("10s", "read committed")


def test_what_the_url_says_is_heeded(postgresql):
    patient = Database(f"{postgresql.url}&connect_timeout=77")
    with patient.read() as connection:
        assert connection.connection.dbapi_connection.info.get_parameters()["connect_timeout"] == "77"
    patient.close()


@pytest.mark.ci
def test_a_server_that_takes_connections_and_never_answers_is_given_up(monkeypatch):
    """As one that was stopped, or is behind a wall."""
    monkeypatch.setitem(connections.CONNECTING, "connect_timeout", 2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        database = Database(f"postgresql+psycopg://nobody@127.0.0.1:{silent.getsockname()[1]}/none")
        began = time.monotonic()
        with pytest.raises(StoreUnavailableError, match="timeout"):
            database.write(executing("SELECT 1"))
        assert time.monotonic() - began < 25
        database.close()


def test_many_who_open_a_new_file_at_once_all_succeed(tmp_path):
    """The API and the coordinator do, at the first start: of those who turn a file to its log, one may."""
    for turn in range(10):
        made = [Database(f"sqlite:///{tmp_path / f'{turn}.db'}") for _ in range(8)]
        answers = at_once([partial(each.write, executing("SELECT 1")) for each in made])
        assert not [answer for answer in answers if isinstance(answer, Exception)]
        for each in made:
            each.close()


def test_a_writer_that_cannot_start_keeps_nobody_waiting(sqlite, monkeypatch):
    """Where there are too many threads already: whoever comes next tries again."""
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
