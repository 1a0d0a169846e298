"""Backup of a running service into a folder, its verification, and its restoration into an empty service.

A backup has the rows of all tables at one moment, one JSON document in each line, and the blobs that they
name. It does not depend on the kind of database: a backup from SQLite can be restored into PostgreSQL.

::

    manifest.json        version, revision, and for each table the number of rows and the SHA-256 of its file
    tables/NAME.jsonl.gz
    blobs/xx/SHA-256
"""

import gzip
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, MetaData, Table, func, select, text

from islands.errors import IslandsError
from islands_service.domain.job import ISLANDS_VERSION
from islands_service.store.blobs import BlobNotFoundError, Blobs, hash_file
from islands_service.store.database import Database
from islands_service.store.migrations.upgrade import HEAD, revision, upgrade
from islands_service.store.retention import Retention
from islands_service.store.tables import jobs, metadata

#: File that is written last: without it a backup is incomplete.
MANIFEST = "manifest.json"

#: Attempts to copy the checkpoints of running jobs, which replace them every few seconds.
_ATTEMPTS = 20

#: Rows that are inserted by one statement.
_BATCH = 500


class BackupError(IslandsError):
    """A backup is incomplete or damaged, or its target is in use."""


def create_backup(
    database: Database, blobs: Blobs, target: Path, report: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """Write a backup of a service, which may run meanwhile; return its manifest.

    Parameters
    ----------
    target : Path
        New or empty folder.
    report : callable
        Receives a line for the user before each step.

    Raises
    ------
    BackupError
        The folder is not empty, or a file that a row names is missing.
    """
    target.mkdir(parents=True, exist_ok=True, mode=0o700)
    if any(target.iterdir()):
        raise BackupError(f"{target} is not empty: give a new folder")
    copies = Blobs(target / "blobs")
    report("reading the database")
    with _snapshot_with_checkpoints(database, blobs, copies) as connection:
        tables = {
            table.name: _write_table(connection, table, target / "tables") for table in metadata.sorted_tables
        }
        named = Retention.named_blobs_of(connection)
    report(f"copying {len(named)} files")
    for blob in sorted(named - {blob for blob, _ in copies.all()}):
        try:
            copy_blob(blobs, copies, blob)
        except BlobNotFoundError as error:
            raise BackupError(
                f"the service has lost the file {blob}: restore it from an earlier backup"
            ) from error
    manifest = {"islands": ISLANDS_VERSION, "revision": HEAD, "tables": tables, "blobs": len(named)}
    (target / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n")
    return manifest


@contextmanager
def _snapshot_with_checkpoints(database: Database, blobs: Blobs, copies: Blobs) -> Iterator[Connection]:
    """Open a snapshot of the database whose checkpoints have been copied.

    A coordinator deletes a checkpoint as soon as the next one is stored. If one vanishes before it is copied,
    a new snapshot is taken.
    """
    for left in reversed(range(_ATTEMPTS)):
        with database.snapshot() as connection:
            query = select(jobs.c.checkpoint).where(jobs.c.checkpoint.is_not(None))
            try:
                for checkpoint in connection.execute(query).scalars().all():
                    copy_blob(blobs, copies, checkpoint)
                    connection.execute(text("SELECT 1"))  # PostgreSQL ends transactions that are idle
            except BlobNotFoundError:
                if left:
                    continue
                raise
            yield connection
            return


def copy_blob(source: Blobs, target: Blobs, blob: str) -> None:
    """Copy a blob.

    Raises
    ------
    BlobNotFoundError
    BackupError
        Its content does not have the SHA-256 of its name.
    """
    with source.open(blob) as stream, target.receiving() as copy:
        shutil.copyfileobj(stream, copy, 1 << 20)
        copied = target.keep(copy)
    if copied != blob:
        raise BackupError(f"the file {blob} is damaged: restore it from an earlier backup")


def _write_table(connection: Connection, table: Table, folder: Path) -> dict[str, Any]:
    folder.mkdir(exist_ok=True, mode=0o700)
    path, count = folder / f"{table.name}.jsonl.gz", 0
    rows = connection.execution_options(yield_per=_BATCH).execute(select(table)).mappings()
    with gzip.GzipFile(path, "wb", mtime=0) as stream:
        for row in rows:
            stream.write(json.dumps(dict(row)).encode() + b"\n")
            count += 1
    return {"rows": count, "sha256": hash_file(path)}


def verify_backup(source: Path, report: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Read a whole backup and check it; return its manifest.

    Raises
    ------
    BackupError
        It is incomplete or damaged.
    """
    manifest = read_manifest(source)
    report("reading the tables")
    named: set[str] = set()
    for name, about in manifest["tables"].items():
        path = source / "tables" / f"{name}.jsonl.gz"
        if not path.is_file() or hash_file(path) != about["sha256"]:
            raise BackupError(f"{path} is missing or damaged: take another backup")
        for row in _read_rows(path):
            named |= {row[column] for column in ("blob", "checkpoint") if row.get(column)}
    report(f"reading {len(named)} files")
    blobs = Blobs(source / "blobs")
    for blob in sorted(named):
        try:
            path = blobs.path(blob)
        except BlobNotFoundError as error:
            raise BackupError(f"the backup lacks the file {blob}: take another one") from error
        if hash_file(path) != blob:
            raise BackupError(f"{path} is damaged: take another backup")
    return manifest


def restore_backup(
    source: Path, database: Database, blobs: Blobs, report: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """Restore a verified backup into a new database and its blobs; return the manifest.

    A backup of an earlier version is migrated. Jobs that were running continue from their checkpoints.

    Raises
    ------
    BackupError
        The backup is incomplete or damaged, or the database is not empty.
    StoreError
        Another version of islands wrote the backup, and this one cannot migrate it.
    """
    manifest = verify_backup(source, report)
    with database.read() as connection:
        if revision(connection) is not None:
            raise BackupError("the database is not empty: give another --data-dir, or an empty --database")
    report("copying the files")
    copies = Blobs(source / "blobs")
    for blob, _ in copies.all():
        copy_blob(copies, blobs, blob)
    report("writing the database")
    with database.exclusive() as connection:
        upgrade(connection, manifest["revision"])
        # The tables as that revision made them.
        made = MetaData()
        made.reflect(connection)
        for table in (each for each in made.sorted_tables if each.name in manifest["tables"]):
            rows = _read_rows(source / "tables" / f"{table.name}.jsonl.gz")
            while batch := list(islice(rows, _BATCH)):
                connection.execute(table.insert(), batch)
            _advance_sequence(connection, table)
        upgrade(connection)
    return manifest


def _advance_sequence(connection: Connection, table: Table) -> None:
    """Let PostgreSQL continue to number new rows after the restored ones."""
    column = table.autoincrement_column
    if connection.dialect.name == "postgresql" and column is not None:
        sequence = func.pg_get_serial_sequence(table.name, column.name)
        connection.execute(select(func.setval(sequence, select(func.max(column)).scalar_subquery())))


def read_manifest(source: Path) -> dict[str, Any]:
    """Return the manifest of a backup.

    Raises
    ------
    BackupError
        The folder is no backup, or an incomplete one.
    """
    try:
        return dict(json.loads((source / MANIFEST).read_text()))
    except (OSError, ValueError) as error:
        raise BackupError(f"{source} is no complete backup: it has no readable {MANIFEST}") from error


def _read_rows(path: Path) -> Iterator[Mapping[str, Any]]:
    with gzip.open(path, "rt", encoding="utf-8") as stream:
        for line in stream:
            yield json.loads(line)
