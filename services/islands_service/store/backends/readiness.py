"""Readiness of the database: it is complete and undamaged, and accepts writes."""

import sqlite3
from contextlib import closing

from sqlalchemy import delete, false, inspect, make_url
from sqlalchemy.exc import SQLAlchemyError

from islands_service.store.database import Database, StoreError, StoreUnavailableError
from islands_service.store.tables import metadata, retired_keys

#: Steps of SQLite's virtual machine between two checks of the budget of a check of the file.
_STEPS = 10_000

#: Largest number of these checks: a file of some hundred megabytes is checked as far as that.
_MAX_CHECKS = 5_000


class DatabaseDamagedError(StoreUnavailableError):
    """The database is damaged or incomplete: stop the service and restore a backup."""


def check_database(database: Database) -> None:
    """Check that a database can accept a job.

    The pages of SQLite are read from the file, not from the cache of a connection.

    Raises
    ------
    DatabaseDamagedError
        Pages of the file are damaged, or tables are missing.
    StoreError
        The database does not answer, or cannot be written.
    """
    try:
        with database.read() as connection:
            missing = sorted(set(metadata.tables) - set(inspect(connection).get_table_names()))
        if missing:
            raise DatabaseDamagedError(
                f"the database lacks the tables {', '.join(missing)}: restore a backup"
            )
        if database.url.startswith("sqlite"):
            _check_file(str(make_url(database.url).database))
        # A statement that changes nothing takes the lock of a writer, which a read-only database refuses.
        database.write(lambda connection: connection.execute(delete(retired_keys).where(false())))
    except StoreError:
        raise
    except (SQLAlchemyError, sqlite3.DatabaseError) as error:
        raise DatabaseDamagedError(f"the database cannot be used ({error}): restore a backup") from error


def _check_file(path: str) -> None:
    checks = 0

    def is_over() -> bool:
        nonlocal checks
        checks += 1
        return checks > _MAX_CHECKS

    with closing(sqlite3.connect(path, timeout=1.0)) as connection:
        connection.set_progress_handler(is_over, _STEPS)
        try:
            (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        except sqlite3.OperationalError as error:
            if error.sqlite_errorname == "SQLITE_INTERRUPT":
                return
            raise
    if found != "ok":
        raise DatabaseDamagedError(f"pages of the database are damaged ({found}): restore a backup")
