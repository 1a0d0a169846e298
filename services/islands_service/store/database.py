"""Database access with concurrent reads, group commit and translated errors.

Every write waits until it is durable. Writes that arrive while a group is being committed form the next
group. If one of them fails, the group is repeated with a savepoint for each. With sixteen clients this
accepts three times as many jobs as one transaction per job, and the longest wait is a twentieth (decision
0009).
"""

import os
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from time import monotonic
from typing import Any, TypeVar

from sqlalchemy import Column, Connection, PoolProxiedConnection, Row, Select, make_url, tuple_
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from islands.errors import IslandsError
from islands_service.store import dialect
from islands_service.store.dialect import make_engine

T = TypeVar("T")

#: An operation, and the future that its caller waits for.
_Waiting = tuple[Callable[[Connection], Any], Future[Any]]

#: Returned value and raised error of an operation.
_OperationResult = tuple[Any, Exception | None]

#: Largest number of operations of one transaction.
MAX_GROUP_SIZE = 64

#: Attempts at an operation whose transaction is rolled back because of a conflict.
_MAX_TRIES = 5

#: SQLSTATEs of PostgreSQL for a full disk.
_FULL_STATES = ("53100",)

#: Prefixes of the SQLSTATEs of PostgreSQL for a server that is shutting down, unreachable, or read-only since
#: a standby has taken over.
_UNAVAILABLE_STATES = ("08", "57P", "25006")

#: SQLSTATEs of PostgreSQL for a serialisation failure and a deadlock.
_COLLISION_STATES = ("40001", "40P01")

#: Names of the errors of SQLite for a file that is no database, and for one with damaged pages.
_DAMAGED_NAMES = ("SQLITE_NOTADB", "SQLITE_CORRUPT")

#: Bytes of the reserve, and its largest share of the disk.
_BYTES, _SHARE = 8_000_000, 0.05


class StoreError(IslandsError):
    """The store cannot perform the operation."""


class StoreUnavailableError(StoreError):
    """The database does not answer. Nothing was written; try again."""


class DatabaseDamagedError(StoreUnavailableError):
    """The database is damaged or incomplete: stop the service and restore a backup."""


class StoreCollisionError(StoreUnavailableError):
    """The transaction was rolled back because of a deadlock or a conflict. Nothing was written; try again."""


class CommitUnknownError(StoreUnavailableError):
    """The connection to the database was lost during a commit: it is unknown whether it was written."""


class StorageFullError(StoreError):
    """The disk is full. Nothing was written, and accepted data are safe; free some space and try again."""


class Database:
    """A database by its URL: ``sqlite:////path/islands.db`` or ``postgresql+psycopg://...``."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = make_engine(url)
        self.reserve = DiskReserve(url)
        self._writing = self.engine.execution_options(writes=True)
        self._patient = self.engine.execution_options(patient=True)
        self._waiting: SimpleQueue[_Waiting | None] = SimpleQueue()
        # Observer of the changes of other connections, and the number of its last state.
        self._observer: PoolProxiedConnection | None = None
        self._seen: int | None = None
        self._writer: Thread | None = None
        self._closed = False
        #: Called with the seconds of each group commit.
        self.observe_commit: Callable[[float], None] = ignore_duration
        # Ensures that concurrent first writers start one thread, and that no operation is queued after the
        # end.
        self._lock = Lock()

    def close(self) -> None:
        """Write the queued operations and close all connections."""
        with self._lock:
            self._closed, writer = True, self._writer
            self._waiting.put(None)
        if writer is not None:
            writer.join()
        if self._observer is not None:
            self._observer.close()
        self.engine.dispose()

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a connection for reading: each statement sees the state that was durable when it began.

        Raises
        ------
        StoreUnavailableError, StorageFullError
        StoreError
            The database is closed.
        """
        self._check_open()
        with translate_db_errors(), self.engine.begin() as connection:
            yield connection

    def write(self, operation: Callable[[Connection], T], urgent: bool = False) -> T:
        """Run an operation in a transaction; return its value once the transaction is durable.

        An error of the operation is raised here, and rolls back only the work of this operation. The
        operation must have no effect but that on the database, since it is repeated if another one fails.

        Parameters
        ----------
        urgent : bool
            Whether the operation may use the reserve of a full disk: it deletes or ends something, or states
            that a job waits for the disk.

        Raises
        ------
        StoreUnavailableError, StorageFullError
            Nothing was written.
        CommitUnknownError
            It is unknown whether the operation was written.
        StoreError
            The database is closed.
        """
        try:
            return self._write(operation)
        except StorageFullError:
            if not urgent:
                raise
        with self.reserve.release():
            return self._write(operation)

    def _write(self, operation: Callable[[Connection], T]) -> T:
        done: Future[T] = Future()
        with self._lock:
            self._check_open()
            if self._writer is None:
                writer = Thread(target=self._write_groups, name="store writer", daemon=True)
                # Store the thread only after it has started: later operations would wait for a dead one for
                # ever.
                writer.start()
                self._writer = writer
            self._waiting.put((operation, done))
        return done.result()

    def has_changed(self) -> bool:
        """Return whether the database may have changed since the last call; called from one thread.

        SQLite counts the commits of all connections but the one that asks. That takes microseconds, without
        the layers above the driver. PostgreSQL has no such number, and the answer is always true.

        Raises
        ------
        StoreUnavailableError
        """
        self._check_open()
        if self.engine.dialect.name != "sqlite":
            return True
        if self._observer is None:
            with translate_db_errors():
                self._observer = self.engine.raw_connection()
        driver, before = self._observer.driver_connection, self._seen
        assert driver is not None
        try:
            (self._seen,) = driver.execute("PRAGMA data_version").fetchone()
        except sqlite3.Error:
            # It may have: the statement that the answer leads to meets the same error.
            return True
        return self._seen != before

    @contextmanager
    def snapshot(self) -> Iterator[Connection]:
        """Open a connection for reading whose statements all see one state of the database.

        Raises
        ------
        StoreUnavailableError
        """
        self._check_open()
        with translate_db_errors(), self._patient.begin() as connection:
            dialect.begin_snapshot(connection)
            yield connection

    @contextmanager
    def exclusive(self) -> Iterator[Connection]:
        """Open a writing transaction outside the groups, for migrations."""
        with translate_db_errors(), self._patient.execution_options(writes=True).begin() as connection:
            yield connection

    def _check_open(self) -> None:
        if self._closed:
            raise StoreError("the store is closed: open it again")

    def _write_groups(self) -> None:
        while (first := self._waiting.get()) is not None:
            group, last = [first], False
            while len(group) < MAX_GROUP_SIZE:
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

    def _write_group(self, group: list[_Waiting], tries: int = _MAX_TRIES) -> None:
        operations = [operation for operation, _ in group]
        try:
            results = self._run_group(operations)
        except StoreCollisionError as error:
            if tries > 1:
                # Retry one by one: shorter transactions hold fewer locks.
                for each in group:
                    self._write_group([each], tries - 1)
                return
            results = [(None, error)] * len(group)
        except Exception as error:
            results = [(None, error)] * len(group)
        for (_, done), (value, failure) in zip(group, results, strict=True):
            if failure is None:
                done.set_result(value)
            else:
                done.set_exception(failure)

    def _run_group(self, operations: list[Callable[[Connection], Any]]) -> list[_OperationResult]:
        """Run operations in one transaction; return their results, including errors, once it is durable."""
        try:
            return self._run_transaction(operations, _run_operation)
        except (StoreUnavailableError, StorageFullError):
            raise
        except Exception as error:
            if len(operations) == 1:
                return [(None, error)]
            return self._run_transaction(operations, _run_in_savepoint)

    def _run_transaction(
        self,
        operations: list[Callable[[Connection], Any]],
        run: Callable[[Callable[[Connection], Any], Connection], _OperationResult],
    ) -> list[_OperationResult]:
        committing, began = False, monotonic()
        try:
            with translate_db_errors(), self._writing.begin() as connection:
                results = [run(operation, connection) for operation in operations]
                committing = True
        except StoreCollisionError:
            raise
        except StoreUnavailableError as error:
            if not committing:
                raise
            raise CommitUnknownError(
                "the connection to the database was lost during the commit, and it is unknown whether the "
                "transaction was written: check, or repeat the request with the same idempotency key"
            ) from error
        self.observe_commit(monotonic() - began)
        return results


class DatabaseOperations:
    """Group of operations on a database; see `islands_service.store.operations.Store`."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def _read_page(
        self,
        query: Select[Any],
        order: Column[Any],
        identity: Column[Any],
        after: tuple[float, str] | None,
        limit: int,
        is_descending: bool = True,
    ) -> tuple[Sequence[Row[Any]], tuple[float, str] | None]:
        """Return the rows that follow a position, and the position of the next page if there is one.

        A position is the value by which the rows are ordered, and the id of the last row of a page.
        """
        if after is not None:
            place = tuple_(order, identity)
            query = query.where(place < tuple_(*after) if is_descending else place > tuple_(*after))
        columns = (order, identity)
        query = query.order_by(*(each.desc() if is_descending else each for each in columns)).limit(limit + 1)
        with self._database.read() as connection:
            rows = connection.execute(query).all()
        last = rows[limit - 1]._mapping if len(rows) > limit else None
        return rows[:limit], None if last is None else (last[order], last[identity])


def ignore_duration(_seconds: float) -> None:
    """Do nothing with the duration of a write; the default of observers."""


def _run_operation(operation: Callable[[Connection], Any], connection: Connection) -> _OperationResult:
    """Run an operation; its error ends the transaction."""
    return operation(connection), None


def _run_in_savepoint(operation: Callable[[Connection], Any], connection: Connection) -> _OperationResult:
    """Run an operation in its own savepoint, so that its error rolls back nothing else."""
    savepoint = connection.begin_nested()
    try:
        value = operation(connection)
        savepoint.commit()
    except Exception as error:
        if isinstance(error, DBAPIError) and _translate(error) is not None:
            raise
        savepoint.rollback()
        return None, error
    return value, None


@contextmanager
def translate_db_errors() -> Iterator[None]:
    """Translate driver errors of a full or unavailable database to `StoreError`."""
    try:
        yield
    except PoolTimeout as error:
        raise StoreUnavailableError("all connections to the database are in use: try again") from error
    except DBAPIError as error:
        translated = _translate(error)
        if translated is None:
            raise
        raise translated from error


def _translate(error: DBAPIError) -> StoreError | None:
    """Return the `StoreError` for a driver error; None if the error is that of a single statement."""
    cause = error.orig
    state = str(getattr(cause, "sqlstate", None) or "")
    text = str(cause)
    if state in _FULL_STATES or (isinstance(cause, sqlite3.Error) and _is_full(cause)):
        return StorageFullError(f"the disk of the database is full ({text}): nothing was written; make room")
    if getattr(cause, "sqlite_errorname", "") in _DAMAGED_NAMES:
        return DatabaseDamagedError(
            f"the database cannot be used ({text}): restore a backup, or give another folder or database"
        )
    if state in _COLLISION_STATES:
        return StoreCollisionError(
            f"a concurrent transaction conflicts ({text}): nothing was written; try again"
        )
    if error.connection_invalidated or state.startswith(_UNAVAILABLE_STATES):
        return StoreUnavailableError(f"the database does not answer ({text}): nothing was written; try again")
    # SQLite also reports an invalid statement as an operational error: only that statement fails.
    if isinstance(error, OperationalError) and getattr(cause, "sqlite_errorname", "") != "SQLITE_ERROR":
        return StoreUnavailableError(
            f"the database cannot be used now ({text}): nothing was written; try again"
        )
    return None


def _is_full(error: sqlite3.Error) -> bool:
    name = getattr(error, "sqlite_errorname", "")
    # On a full disk the shared memory of SQLite's readers cannot grow, which is reported as a write error.
    return name == "SQLITE_FULL" or name in (
        "SQLITE_IOERR_WRITE",
        "SQLITE_IOERR_SHMSIZE",
        "SQLITE_IOERR_FSYNC",
    )


class DiskReserve:
    """File that takes disk space until an operation needs it.

    Parameters
    ----------
    url : str
        URL of the database. One that is not a file on this machine has no reserve.
    """

    def __init__(self, url: str) -> None:
        name = make_url(url).database if url.startswith("sqlite") else None
        self._path = None if name is None else Path(f"{name}-reserve")

    def fill(self) -> None:
        """Allocate the reserve unless that would take half of the space that is left."""
        if self._path is None:
            return
        with suppress(OSError), self._path.open("ab") as stream:
            disk = os.statvfs(stream.fileno())
            size = min(_BYTES, int(_SHARE * disk.f_blocks * disk.f_frsize))
            if os.fstat(stream.fileno()).st_size < size and 2 * size < disk.f_bavail * disk.f_frsize:
                os.posix_fallocate(stream.fileno(), 0, size)

    @contextmanager
    def release(self) -> Iterator[None]:
        """Free the reserve during the block, and fill it again as far as there is room."""
        with suppress(OSError):
            if self._path is not None:
                os.truncate(self._path, 0)
        try:
            yield
        finally:
            self.fill()
