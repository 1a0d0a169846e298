"""Readiness of the database: it is complete and undamaged, and accepts writes."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Event, Thread
from time import monotonic

import structlog
from sqlalchemy import delete, false, inspect, make_url
from sqlalchemy.exc import SQLAlchemyError

from islands_service.store.database import Database, DatabaseDamagedError, StoreError
from islands_service.store.tables import metadata, retired_keys

log = structlog.get_logger()

#: Largest size in bytes of a file that every check reads completely, in about 10 ms.
_MAX_SMALL_FILE = 2_000_000

#: Least ratio of the pause between two complete checks to the duration of one.
_PAUSE_RATIO = 50.0


class Readiness:
    """Checks of a database.

    A complete check of a large file takes seconds. `watch` does it in the background, and `check` raises the
    error that the last one has found.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        name = make_url(database.url).database if database.url.startswith("sqlite") else None
        self._file = None if name is None else Path(name)
        self._damage: DatabaseDamagedError | None = None
        self._stopped = Event()

    def check(self) -> None:
        """Check that the database can accept a job.

        Raises
        ------
        DatabaseDamagedError
            Pages of the file are damaged, or tables are missing.
        StoreError
            The database does not answer, or cannot be written.
        """
        if self._damage is not None:
            raise self._damage
        with _explain_damage():
            with self._database.read() as connection:
                missing = sorted(set(metadata.tables) - set(inspect(connection).get_table_names()))
            if missing:
                raise DatabaseDamagedError(
                    f"the database lacks the tables {', '.join(missing)}: restore a backup"
                )
            if self._file is not None and self._file.stat().st_size <= _MAX_SMALL_FILE:
                _check_pages(self._file)
            # A statement that changes nothing takes the lock of a writer, which a read-only database refuses.
            self._database.write(lambda connection: connection.execute(delete(retired_keys).where(false())))

    def check_file(self) -> None:
        """Check all pages of a database in SQLite.

        Raises
        ------
        DatabaseDamagedError
            Pages are damaged. `check` raises the same until a complete check finds no damage.
        """
        try:
            with _explain_damage():
                if self._file is not None:
                    _check_pages(self._file)
        except DatabaseDamagedError as error:
            self._damage = error
            raise
        self._damage = None

    def watch(self, seconds: float) -> None:
        """Check all pages now and after pauses of at least some seconds, in a thread, until `stop`."""
        # SQLite does not interrupt a check, and the end of the process does not wait for a daemon.
        Thread(target=self._watch, args=(seconds,), name="islands-readiness", daemon=True).start()

    def stop(self) -> None:
        """Begin no further check in the background."""
        self._stopped.set()

    def _watch(self, seconds: float) -> None:
        pause = 0.0
        while not self._stopped.wait(pause):
            began = monotonic()
            try:
                self.check_file()
            except DatabaseDamagedError as error:
                log.error("the database is damaged", reason=str(error))
            except OSError as error:
                log.warning("the database is not checked", reason=str(error))
            pause = max(seconds, _PAUSE_RATIO * (monotonic() - began))


def _check_pages(file: Path) -> None:
    """Check the pages in the file, not those in the cache of a connection."""
    with closing(sqlite3.connect(file, timeout=1.0)) as connection:
        (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if found != "ok":
        raise DatabaseDamagedError(f"pages of the database are damaged ({found}): restore a backup")


@contextmanager
def _explain_damage() -> Iterator[None]:
    try:
        yield
    except StoreError:
        raise
    except (SQLAlchemyError, sqlite3.DatabaseError) as error:
        raise DatabaseDamagedError(f"the database cannot be used ({error}): restore a backup") from error
