"""Backups of a store: complete at one moment, verifiable, and restorable into either kind of database."""

import gzip
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from islands_service.backup import MANIFEST, BackupError, create_backup, restore_backup, verify_backup
from islands_service.domain.job import Job, ProgressReport, Requester
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import Database, StoreError
from islands_service.store.tables import jobs, metadata
from support.stores import ALICE, BOB, FOUND, asked, claimed, submitted

Rows = dict[str, list[tuple[Any, ...]]]


@pytest.fixture
def blobs(tmp_path: Path) -> Blobs:
    return Blobs(tmp_path / "blobs")


def rows_of(database: Database) -> Rows:
    """Return the rows of all tables."""
    with database.read() as connection:
        return {
            table.name: sorted(map(tuple, connection.execute(select(table))), key=repr)
            for table in metadata.sorted_tables
        }


def read_rows(backup: Path) -> list[dict[str, Any]]:
    """Return the jobs of a backup."""
    with gzip.open(backup / "tables/jobs.jsonl.gz", "rt") as stream:
        return [json.loads(line) for line in stream]


def fill(store: Store, blobs: Blobs) -> Job:
    """Store a job of each kind of state, a data set, keys and audit entries; return the running job."""
    record = blobs.write(b"a record")
    preview = {"samples": 3, "columns": [], "time": None, "dt": 0.1, "warnings": [], "name": "ü\u2028"}
    store.datasets.add(ALICE, "a.csv", ".csv", record, 8, preview)
    finished = submitted(store)
    store.leases.finish(claimed(store), FOUND)
    store.results.keep(finished.id, {"report.html": blobs.write(b"a report")})
    running = submitted(store, BOB, priority=3, idempotency_key="k")
    lease = claimed(store)
    store.leases.report(lease, ProgressReport({"generation": 7}, checkpoint=blobs.write(b"a checkpoint")))
    submitted(store)
    store.keys.create("lab", frozenset({"read"}))
    return running


@contextmanager
def restored(source: Path, url: str, blobs: Blobs) -> Iterator[Store]:
    database = Database(url)
    restore_backup(source, database, blobs)
    database.close()
    with Store(url) as store:
        yield store


def test_a_restored_store_equals_the_stored_one(
    store: Store, blobs: Blobs, tmp_path: Path, empty_database: str
) -> None:
    """Also if one is SQLite and the other PostgreSQL: the parameters are all four pairs."""
    running = fill(store, blobs)
    before, backup, copies = rows_of(store.database), tmp_path / "backup", Blobs(tmp_path / "restored")
    manifest = create_backup(store.database, blobs, backup)
    assert manifest["blobs"] == 3
    assert verify_backup(backup) == manifest
    # The fixture gives a new SQLite database the path of the stored one.
    target = f"sqlite:///{tmp_path / 'new.db'}" if "sqlite" in empty_database else empty_database
    with restored(backup, target, copies) as again:
        assert rows_of(again.database) == before
        assert {blob for blob, _ in copies.all()} == {blob for blob, _ in blobs.all()}
        found = again.jobs.get(BOB, running.id)
        assert found.checkpoint is not None
        assert copies.read(found.checkpoint) == b"a checkpoint"
        # New rows get new numbers.
        audited = len(again.audit.entries())
        again.jobs.submit(asked(), by=Requester("here"))
        assert len(again.audit.entries()) == audited + 1


def test_a_backup_of_an_unknown_version_is_refused(tmp_path: Path, sqlite_database: str) -> None:
    with Store(sqlite_database) as store:
        create_backup(store.database, Blobs(tmp_path / "blobs"), tmp_path / "backup")
    path = tmp_path / "backup" / MANIFEST
    path.write_text(json.dumps({**json.loads(path.read_text()), "revision": "0012"}))
    target = Database(f"sqlite:///{tmp_path / 'new.db'}")
    with pytest.raises(StoreError, match="the revision 0012"):
        restore_backup(tmp_path / "backup", target, Blobs(tmp_path / "restored"))
    with target.read() as connection:
        assert not connection.dialect.get_table_names(connection)
    target.close()


def test_a_backup_has_the_checkpoints_of_its_moment(store: Store, blobs: Blobs, tmp_path: Path) -> None:
    """A coordinator deletes a checkpoint as soon as it has stored the next one."""
    submitted(store)
    lease, over, written = claimed(store), threading.Event(), 0

    def replace_checkpoints() -> None:
        nonlocal written
        last = None
        while not over.is_set():
            written += 1
            checkpoint = blobs.write(f"checkpoint {written}".encode())
            store.leases.report(lease, ProgressReport({"generation": written}, checkpoint=checkpoint))
            if last is not None:
                blobs.path(last).unlink()
            last = checkpoint

    thread = threading.Thread(target=replace_checkpoints)
    thread.start()
    try:
        for number in range(5):
            backup = tmp_path / f"backup-{number}"
            create_backup(store.database, blobs, backup)
            verify_backup(backup)
            (row,) = read_rows(backup)
            if row["checkpoint"] is not None:
                stored = Blobs(backup / "blobs").read(row["checkpoint"])
                assert stored == f"checkpoint {json.loads(row['progress'])['generation']}".encode()
    finally:
        over.set()
        thread.join()


def _remove_a_table(backup: Path) -> None:
    (backup / "tables/jobs.jsonl.gz").unlink()


def _cut_a_table(backup: Path) -> None:
    path = backup / "tables/jobs.jsonl.gz"
    path.write_bytes(path.read_bytes()[:-10])


def _remove_a_blob(backup: Path) -> None:
    next((backup / "blobs").glob("??/*")).unlink()


def _change_a_blob(backup: Path) -> None:
    next((backup / "blobs").glob("??/*")).write_bytes(b"something else")


def _remove_the_manifest(backup: Path) -> None:
    (backup / MANIFEST).unlink()


@pytest.mark.parametrize(
    "damage", [_remove_a_table, _cut_a_table, _remove_a_blob, _change_a_blob, _remove_the_manifest]
)
def test_a_damaged_backup_is_found_and_not_restored(
    sqlite_database: str, blobs: Blobs, tmp_path: Path, damage: Callable[[Path], None]
) -> None:
    with Store(sqlite_database) as store:
        fill(store, blobs)
        backup = tmp_path / "backup"
        create_backup(store.database, blobs, backup)
    damage(backup)
    with pytest.raises(BackupError):
        verify_backup(backup)
    target = Database(f"sqlite:///{tmp_path / 'new.db'}")
    with pytest.raises(BackupError):
        restore_backup(backup, target, Blobs(tmp_path / "restored"))
    with target.read() as connection:
        assert not connection.dialect.get_table_names(connection)
    target.close()


def test_nothing_is_overwritten(sqlite_database: str, blobs: Blobs, tmp_path: Path) -> None:
    with Store(sqlite_database) as store:
        fill(store, blobs)
        backup = tmp_path / "backup"
        create_backup(store.database, blobs, backup)
        with pytest.raises(BackupError, match="is not empty: give a new folder"):
            create_backup(store.database, blobs, backup)
        with pytest.raises(BackupError, match="the database is not empty"):
            restore_backup(backup, store.database, blobs)


def test_a_lost_file_of_the_service_is_named(sqlite_database: str, blobs: Blobs, tmp_path: Path) -> None:
    with Store(sqlite_database) as store:
        fill(store, blobs)
        with store.database.read() as connection:
            checkpoints = set(connection.execute(select(jobs.c.checkpoint)).scalars())
        lost = next(blob for blob, _ in blobs.all() if blob not in checkpoints)
        blobs.path(lost).unlink()
        with pytest.raises(BackupError, match=lost):
            create_backup(store.database, blobs, tmp_path / "backup")
    assert not (tmp_path / "backup" / MANIFEST).exists()
