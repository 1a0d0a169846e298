"""Killed processes, full disks and lost servers: accepted jobs are kept."""

import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from islands_service.domain.job import ProgressReport
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StorageFullError
from support.databases import server
from support.disks import filled, mounted
from support.processes import eventually, kill
from support.stores import (
    ALICE,
    BLOB,
    LONG,
    asked,
    at_once,
    brought_on,
    child,
    claimed,
    kinds,
    stopped_writer,
    submitted,
)

SUBMIT = """
import sys
from concurrent.futures import ThreadPoolExecutor
from islands_service.domain.job import Submission
from islands_service.store import Store
store = Store(sys.argv[1])
def submit(thread):
    number = 0
    while True:
        key = f"{thread} {number}"
        job, _ = store.jobs.submit(Submission("alice", {"key": key}, idempotency_key=key))
        print(f"{job.id} {key}\\n", end="", flush=True)
        number += 1
with ThreadPoolExecutor(4) as pool:
    list(pool.map(submit, range(4)))
"""

REPORT = """
import sys
from islands_service.domain.job import ProgressReport
from islands_service.store import Store
store = Store(sys.argv[1])
lease = store.leases.claim("first", 3600.0)
generation = 0
while True:
    point = (generation, 10 * generation, {3: 0.5}, (0.5,))
    report = ProgressReport({"generation": generation}, (point,), f"{generation:064x}", generation - 1)
    store.leases.report(lease, report)
    print(generation, flush=True)
    generation += 1
"""


#: Bytes of a small disk.
DISK = 2_000_000

#: Bytes that remain on it for the tables.
TABLES = 400_000


def intact(database):
    """Check that a database is not corrupt."""
    if database.startswith("sqlite"):
        with closing(sqlite3.connect(database.removeprefix("sqlite:///"))) as connection:
            assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
            assert connection.execute("PRAGMA foreign_key_check").fetchall() == []


def killed_after(process, lines):
    """Kill a process after some lines of output, and return all of its complete lines."""
    said = [process.stdout.readline() for _ in range(lines)]
    kill(process.pid)
    said += process.stdout.readlines()
    return [line.split() for line in said if line.endswith("\n") and line.strip()]


@pytest.mark.ci
@pytest.mark.parametrize("lines", [1, 40])
def test_acknowledged_jobs_of_a_killed_process_are_stored(database, lines):
    with child(SUBMIT, database) as process:
        acknowledged = killed_after(process, lines)
    intact(database)
    with Store(database) as store:
        for job, *key in acknowledged:
            found = store.jobs.get(ALICE, job)
            assert found.spec == {"key": " ".join(key)}
            assert kinds(store, job) == ["queued"]
        # Unacknowledged jobs may exist or not: a repeated request gets the same job.
        for job, *key in acknowledged:
            name = " ".join(key)
            again, new = store.jobs.submit(asked(spec={"key": name}, idempotency_key=name))
            assert (again.id, new) == (job, False)


@pytest.mark.nightly
def test_repeated_kills_lose_no_acknowledged_job(database):
    acknowledged = []
    for turn in range(15):
        with child(SUBMIT, database) as process:
            acknowledged += killed_after(process, 1 + 7 * turn)
        intact(database)
    with Store(database) as store:
        found = {job: " ".join(key) for job, *key in acknowledged}
        assert all(store.jobs.get(ALICE, job).spec == {"key": key} for job, key in found.items())
        assert len(set(found.values())) == len(found)


@pytest.mark.ci
@pytest.mark.parametrize("reports", [1, *(pytest.param(n, marks=pytest.mark.nightly) for n in (2, 9)), 30])
def test_killed_coordinator_leaves_complete_reports(database, reports):
    with Store(database) as store:
        job = submitted(store)
        with child(REPORT, database) as process:
            reported = killed_after(process, reports)
        # PostgreSQL may still execute the last statement of the killed process: its job is skipped until
        # then.
        again = eventually(lambda: store.leases.claim("first", LONG))
        generation = again.job.progress["generation"]
        assert generation in (len(reported) - 1, len(reported))
        assert (again.epoch, again.job.checkpoint) == (2, f"{generation:064x}")
        assert [each[0] for each in store.results.history(job.id)] == list(range(generation + 1))
        assert kinds(store, job.id) == ["queued", "running", *["progress"] * (generation + 1), "running"]
    intact(database)


@pytest.mark.ci
def test_process_killed_during_a_write_blocks_no_other(database):
    with Store(database) as store:
        job = submitted(store)
        with stopped_writer(database, seconds=60) as process:
            kill(process.pid)
        # PostgreSQL must first notice that the client has ended.
        lease = eventually(lambda: store.leases.claim("second", LONG))
        assert (lease.job.id, lease.epoch, lease.job.progress) == (job.id, 2, None)
        store.leases.report(lease, brought_on(1))
        assert kinds(store, job.id) == ["queued", "running", "running", "progress"]


@pytest.fixture
def disk(small_disk):
    return small_disk(DISK)


def until_full(store, jobs):
    """Submit large jobs until the disk is full; return the error."""
    while True:
        try:
            jobs.append(submitted(store, spec={"text": "x" * 20_000}))
        except StorageFullError as error:
            return error


def test_full_disk_loses_no_job_and_the_store_recovers(disk):
    with Store(f"sqlite:///{disk / 'islands.db'}") as store:
        job = submitted(store, priority=1)
        lease = claimed(store)
        jobs = [submitted(store, name=f"{number}") for number in range(5)]
        before = {each.id: each for each in jobs}
        filler = filled(disk, leave=TABLES)
        assert "make room" in str(until_full(store, jobs))
        # All callers get the error, also concurrent ones, and no partial write is visible.
        answered = at_once([lambda: submitted(store, spec={"text": "x" * 20_000})] * 8)
        assert all(isinstance(each, StorageFullError) for each in answered)
        with pytest.raises(StorageFullError):
            store.leases.report(lease, ProgressReport({"text": "x" * 50_000}, (), BLOB))
        assert store.jobs.get(ALICE, job.id) == lease.job
        assert {each.id for each in store.jobs.page(ALICE, limit=200).jobs} == {
            job.id,
            *(each.id for each in jobs),
        }
        assert all(store.jobs.get(ALICE, name) == each for name, each in before.items())
        filler.unlink()
        jobs.append(submitted(store, spec={"text": "y" * 20_000}))
        store.leases.report(lease, brought_on(1))
        assert kinds(store, job.id) == ["queued", "running", "progress"]
    intact(f"sqlite:///{disk / 'islands.db'}")
    with Store(f"sqlite:///{disk / 'islands.db'}") as store:
        assert {each.id for each in store.jobs.page(ALICE, limit=200).jobs} == {
            job.id,
            *(each.id for each in jobs),
        }


def test_accepted_jobs_can_be_read_from_a_completely_full_disk(disk):
    url = f"sqlite:///{disk / 'islands.db'}"
    with Store(url) as store:
        job = submitted(store)
        filler = filled(disk)
        with pytest.raises(StorageFullError):
            submitted(store, spec={"text": "x" * 100_000})
        assert store.jobs.get(ALICE, job.id) == job
        filler.unlink()
        submitted(store)


def test_store_opens_again_when_a_full_disk_has_space(disk):
    url = f"sqlite:///{disk / 'islands.db'}"
    with Store(url) as store:
        job = submitted(store)
    filler = filled(disk)
    # The log and the shared memory of the readers are files, too.
    with pytest.raises(StorageFullError, match="make room"):
        Store(url)
    filler.unlink()
    with Store(url) as store:
        assert store.jobs.get(ALICE, job.id) == job
        submitted(store)


def test_full_disk_refuses_new_blobs_and_keeps_existing_ones(disk):
    blobs = Blobs(disk / "blobs")
    kept = blobs.write(b"kept" * 1000)
    filler = filled(disk, leave=100_000)
    for size in (150_000, 10_000_000):
        with pytest.raises(StorageFullError, match="make room"):
            blobs.write(bytes(size))

    def receive():
        with blobs.receiving() as stream:
            while True:
                stream.write(bytes(5000))

    with pytest.raises(StorageFullError):
        receive()
    assert [blob for blob, _ in blobs.all()] == [kept]
    small = blobs.write(b"small")
    filler.unlink()
    large = blobs.write(bytes(150_000))
    assert {blob for blob, _ in blobs.all()} == {kept, small, large}
    assert blobs.read(kept) == b"kept" * 1000


@pytest.mark.nightly
def test_full_disk_of_postgresql_loses_no_job_and_the_store_recovers(monkeypatch):
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)  # the account of the server has to enter it
        with mounted(Path(folder) / "disk", 150_000_000, mode="0777") as full:
            monkeypatch.setattr(tempfile, "tempdir", str(full))
            with server(max_wal_size="48MB") as running, Store(running.url) as store:
                jobs = [submitted(store) for _ in range(3)]
                filler = filled(full)
                assert "make room" in str(until_full(store, jobs))
                assert store.jobs.get(ALICE, jobs[1].id) == jobs[1]
                filler.unlink()
                jobs.append(submitted(store, spec={"text": "x" * 20_000}))
                kept = {each.id for each in store.jobs.page(ALICE, limit=200).jobs}
                assert kept == {each.id for each in jobs}
