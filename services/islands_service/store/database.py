"""A database behind one door: reads side by side, writes in groups, errors that say what to do.

Every write waits until it is durable. Those that come while another group is being written to the disk make
the next group, each in a savepoint of its own: sixteen clients get three times as many jobs accepted as with
a transaction each, and the slowest waits a twentieth of the time (decision 0009).
"""

import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from islands.errors import IslandsError

T = TypeVar("T")

#: The most operations of one transaction.
GROUP = 64

#: Seconds that SQLite waits for another process's transaction.
PATIENCE = 30.0

#: What a connection to SQLite is told: an acknowledged write is on the disk, and readers do not wait.
_PRAGMAS = (
    "journal_mode=WAL",
    "synchronous=FULL",
    f"busy_timeout={int(1000 * PATIENCE)}",
    "foreign_keys=ON",
)

#: PostgreSQL's states for a full disk, and beginnings of those for a database that is going or gone.
_FULL_STATES = ("53100",)
_GONE_STATES = ("08", "57P")


class StoreError(IslandsError):
    """The store cannot do what is asked."""


class StoreUnavailable(StoreError):
    """The database does not answer. Nothing was written; try again."""


class StoreFull(StoreError):
    """The disk is full. Nothing was written, and nothing that was accepted is lost; make room."""


class Database:
    """A database by its URL: ``sqlite:////path/islands.db`` or ``postgresql+psycopg://...``.

    Parameters
    ----------
    url : str
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = _engine(url)
        self._writing = self.engine.execution_options(writes=True)
        self._waiting: SimpleQueue[tuple[Callable[[Connection], Any], Future[Any]] | None] = SimpleQueue()
        self._writer: Thread | None = None

    def close(self) -> None:
        """Write what is waiting, and let go of the database."""
        if self._writer is not None:
            self._waiting.put(None)
            self._writer.join()
            self._writer = None
        self.engine.dispose()

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a transaction that reads.

        Raises
        ------
        StoreUnavailable, StoreFull
        """
        with told(), self.engine.begin() as connection:
            yield connection

    def write(self, operation: Callable[[Connection], T]) -> T:
        """Carry out an operation in a transaction, and return what it returns once that is durable.

        What it raises is raised here, and undoes nothing but its own work.

        Raises
        ------
        StoreUnavailable, StoreFull
            Nothing was written.
        """
        if self._writer is None:
            self._writer = Thread(target=self._write_groups, name="store writer", daemon=True)
            self._writer.start()
        done: Future[T] = Future()
        self._waiting.put((operation, done))
        return done.result()

    @contextmanager
    def alone(self) -> Iterator[Connection]:
        """Open a transaction that writes, outside of any group: for migrations."""
        with told(), self._writing.begin() as connection:
            yield connection

    def _write_groups(self) -> None:
        while (first := self._waiting.get()) is not None:
            group, last = [first], False
            while len(group) < GROUP:
                try:
                    following = self._waiting.get_nowait()
                except Empty:
                    break
                if following is None:
                    last = True
                    break
                group.append(following)
            self._write_group(group)
            if last:
                return

    def _write_group(self, group: list[tuple[Callable[[Connection], Any], Future[Any]]]) -> None:
        answers: list[tuple[Future[Any], Any, Exception | None]] = []
        try:
            with told(), self._writing.begin() as connection:
                for operation, done in group:
                    savepoint = connection.begin_nested()
                    try:
                        value = operation(connection)
                        savepoint.commit()
                    except DBAPIError as error:
                        if _trouble(error) is not None:
                            raise
                        savepoint.rollback()
                        answers.append((done, None, error))
                    except Exception as error:
                        savepoint.rollback()
                        answers.append((done, None, error))
                    else:
                        answers.append((done, value, None))
        except Exception as error:
            answers = [(done, None, error) for _, done in group]
        for done, value, failure in answers:
            if failure is None:
                done.set_result(value)
            else:
                done.set_exception(failure)


@contextmanager
def told() -> Iterator[None]:
    """Turn what a database raises when it is full or gone into our own errors."""
    try:
        yield
    except PoolTimeout as error:
        raise StoreUnavailable("all connections to the database are taken: try again") from error
    except DBAPIError as error:
        trouble = _trouble(error)
        if trouble is None:
            raise
        raise trouble from error


def _trouble(error: DBAPIError) -> StoreError | None:
    """Return what an error of the driver says of the database itself; None if it does not."""
    cause = error.orig
    state = str(getattr(cause, "sqlstate", None) or "")
    text = str(cause)
    if state in _FULL_STATES or (isinstance(cause, sqlite3.Error) and _is_full(cause)):
        return StoreFull(f"the disk of the database is full ({text}): nothing was written; make room")
    if error.connection_invalidated or state.startswith(_GONE_STATES):
        return StoreUnavailable(f"the database does not answer ({text}): nothing was written; try again")
    if isinstance(error, OperationalError):
        return StoreUnavailable(f"the database cannot be used now ({text}): nothing was written; try again")
    return None


def _is_full(error: sqlite3.Error) -> bool:
    name = getattr(error, "sqlite_errorname", "")
    # On a full disk the memory shared by SQLite's readers cannot grow: it says that it cannot write there.
    return name == "SQLITE_FULL" or name in (
        "SQLITE_IOERR_WRITE",
        "SQLITE_IOERR_SHMSIZE",
        "SQLITE_IOERR_FSYNC",
    )


def _engine(url: str) -> Engine:
    if not url.startswith("sqlite"):
        return create_engine(url, pool_size=10, max_overflow=10, pool_pre_ping=True, pool_timeout=PATIENCE)
    engine = create_engine(
        url, connect_args={"timeout": PATIENCE, "check_same_thread": False}, pool_size=10, max_overflow=40
    )

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # we say ourselves when a transaction begins
        for pragma in _PRAGMAS:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begun(connection: Connection) -> None:
        # Who will write says so at once: a reader that turns writer may find that it has read too early.
        writes = connection.get_execution_options().get("writes", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine
