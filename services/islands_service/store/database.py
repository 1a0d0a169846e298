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
from threading import Lock, Thread
from typing import Any, TypeVar

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from islands.errors import IslandsError
from islands_service.store.connections import make_engine

T = TypeVar("T")

#: An operation, and who waits for it; and what an operation came to: what it returned, or what it raised.
_Waiting = tuple[Callable[[Connection], Any], Future[Any]]
_Answer = tuple[Any, Exception | None]

#: The most operations of one transaction, and how often one is tried that had to give way to another one.
GROUP, TRIES = 64, 5

#: PostgreSQL's states for a full disk, and beginnings of those for a database that is going, gone, or not to
#: be written any more, since another one has taken its place.
_FULL_STATES = ("53100",)
_GONE_STATES = ("08", "57P", "25006")

#: PostgreSQL's states for a transaction that gave way to another one.
_COLLISION_STATES = ("40001", "40P01")


class StoreError(IslandsError):
    """The store cannot do what is asked."""


class StoreUnavailableError(StoreError):
    """The database does not answer. Nothing was written; try again."""


class StoreCollisionError(StoreUnavailableError):
    """Two transactions waited for each other, and this one gave way. Nothing was written; try again."""


class CommitUnknownError(StoreUnavailableError):
    """The database went away while it committed: nobody knows whether it was written."""


class StorageFullError(StoreError):
    """The disk is full. Nothing was written, and nothing that was accepted is lost; make room."""


class Database:
    """A database by its URL: ``sqlite:////path/islands.db`` or ``postgresql+psycopg://...``.

    Parameters
    ----------
    url : str
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = make_engine(url)
        self._writing = self.engine.execution_options(writes=True)
        self._waiting: SimpleQueue[_Waiting | None] = SimpleQueue()
        self._writer: Thread | None = None
        self._closed = False
        # One of those who come first starts the writer, and nobody comes behind the end.
        self._lock = Lock()

    def close(self) -> None:
        """Write what is waiting, and let go of the database."""
        with self._lock:
            self._closed, writer = True, self._writer
            self._waiting.put(None)
        if writer is not None:
            writer.join()
        self.engine.dispose()

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a connection that reads: each statement sees what was durable when it began.

        Raises
        ------
        StoreUnavailableError, StorageFullError
        StoreError
            It is closed.
        """
        self._refuse_closed()
        with translate_db_errors(), self.engine.begin() as connection:
            yield connection

    def write(self, operation: Callable[[Connection], T]) -> T:
        """Carry out an operation in a transaction, and return what it returns once that is durable.

        What it raises is raised here, and undoes nothing but its own work.

        Raises
        ------
        StoreUnavailableError, StorageFullError
            Nothing was written.
        CommitUnknownError
            Nobody knows whether it was written.
        StoreError
            It is closed.
        """
        done: Future[T] = Future()
        with self._lock:
            self._refuse_closed()
            if self._writer is None:
                writer = Thread(target=self._write_groups, name="store writer", daemon=True)
                # One that cannot start is no writer: whoever comes next would wait for it for ever.
                writer.start()
                self._writer = writer
            self._waiting.put((operation, done))
        return done.result()

    @contextmanager
    def exclusive(self) -> Iterator[Connection]:
        """Open a transaction that writes, outside of any group: for migrations."""
        with translate_db_errors(), self._writing.begin() as connection:
            yield connection

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StoreError("the store is closed: open it again")

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

    def _write_group(self, group: list[_Waiting], tries: int = TRIES) -> None:
        try:
            answers = self._transaction([operation for operation, _ in group])
        except StoreCollisionError as error:
            if tries > 1:
                # One by one they hold less at a time that others wait for.
                for each in group:
                    self._write_group([each], tries - 1)
                return
            answers = [(None, error)] * len(group)
        except Exception as error:
            answers = [(None, error)] * len(group)
        for (_, done), (value, failure) in zip(group, answers, strict=True):
            if failure is None:
                done.set_result(value)
            else:
                done.set_exception(failure)

    def _transaction(self, operations: list[Callable[[Connection], Any]]) -> list[_Answer]:
        """Carry out a group; return what each came to, once all is durable."""
        committing = False
        try:
            with translate_db_errors(), self._writing.begin() as connection:
                answers = [_carried_out(operation, connection) for operation in operations]
                committing = True
        except StoreCollisionError:
            raise
        except StoreUnavailableError as error:
            if not committing:
                raise
            raise CommitUnknownError(
                "the database went away while it committed, and nobody knows whether it was written: look, "
                "or ask again under the same idempotency key"
            ) from error
        return answers


def _carried_out(operation: Callable[[Connection], Any], connection: Connection) -> _Answer:
    """Carry out an operation in a savepoint of its own: what it raises undoes nothing else."""
    savepoint = connection.begin_nested()
    try:
        value = operation(connection)
        savepoint.commit()
    except Exception as error:
        if isinstance(error, DBAPIError) and _trouble(error) is not None:
            raise
        savepoint.rollback()
        return None, error
    return value, None


@contextmanager
def translate_db_errors() -> Iterator[None]:
    """Turn what a database raises when it is full or gone into our own errors."""
    try:
        yield
    except PoolTimeout as error:
        raise StoreUnavailableError("all connections to the database are taken: try again") from error
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
        return StorageFullError(f"the disk of the database is full ({text}): nothing was written; make room")
    if state in _COLLISION_STATES:
        return StoreCollisionError(f"the database is used by others ({text}): nothing was written; try again")
    if error.connection_invalidated or state.startswith(_GONE_STATES):
        return StoreUnavailableError(f"the database does not answer ({text}): nothing was written; try again")
    # SQLite calls a statement that is wrong in itself operational, too: that one alone fails.
    if isinstance(error, OperationalError) and getattr(cause, "sqlite_errorname", "") != "SQLITE_ERROR":
        return StoreUnavailableError(
            f"the database cannot be used now ({text}): nothing was written; try again"
        )
    return None


def _is_full(error: sqlite3.Error) -> bool:
    name = getattr(error, "sqlite_errorname", "")
    # On a full disk the memory shared by SQLite's readers cannot grow: it says that it cannot write there.
    return name == "SQLITE_FULL" or name in (
        "SQLITE_IOERR_WRITE",
        "SQLITE_IOERR_SHMSIZE",
        "SQLITE_IOERR_FSYNC",
    )
