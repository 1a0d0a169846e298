"""Checkpoints of identification jobs: a lost one costs only time, a superseded one is deleted."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import pytest
from sqlalchemy import update

from islands.evolution.archipelago import Archipelago, Island
from islands.evolution.engine import ArchipelagoEpoch, SerialEngine
from islands_service.coordinator import identification_job as work
from islands_service.coordinator.checkpoints import SEARCH_RESTARTED, JobCheckpoints
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.coordinator.job_failures import JobDeclinedError
from islands_service.domain.job import ISLANDS_VERSION, Job, Lease, LeaseLostError, ProgressReport
from islands_service.runtime import ClusterError
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.database import CommitUnknownError, StoreUnavailableError
from islands_service.store.tables import jobs
from support.job_runs import make_run
from support.stores import ALICE

Found = tuple[list[Any], list[Any]]


class ProcessEndedError(Exception):
    """The process ended."""


def claim(store: Store) -> Lease:
    lease = store.leases.claim("me", 60.0)
    assert lease is not None
    return lease


def interrupt(store: Store, blobs: Blobs, at: int = 3) -> Path:
    """Run a job until a generation; return the path of its checkpoint."""
    lease = claim(store)

    def check() -> None:
        progress = store.jobs.get(ALICE, lease.job.id).progress or {}
        if progress.get("generation", -1) >= at:
            raise ProcessEndedError

    with pytest.raises(ProcessEndedError):
        run_identification_job(make_run(lease, store, blobs, check, 1e-9))
    blob = store.jobs.get(ALICE, lease.job.id).checkpoint
    assert blob is not None
    return blobs.path(blob)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


@pytest.fixture(autouse=True)
def frequent_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)


@pytest.mark.ci
@pytest.mark.parametrize(
    "harm",
    [
        pytest.param(Path.unlink, id="lost"),
        pytest.param(truncate, id="truncated"),
        pytest.param(lambda path: path.write_bytes(b"{}"), id="replaced", marks=pytest.mark.nightly),
        pytest.param(lambda path: path.write_bytes(b""), id="empty", marks=pytest.mark.nightly),
    ],
)
def test_job_without_its_checkpoint_starts_again_with_the_same_result(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found, harm: Callable[[Path], object]
) -> None:
    harm(interrupt(store, blobs))
    lease = claim(store)
    outcome = run_identification_job(make_run(lease, store, blobs, lambda: None, 1e-9))
    assert [json.loads(json.dumps(document)) for document, _ in outcome.models] == undisturbed[0]
    assert store.results.history(job.id) == undisturbed[1]
    ended = store.jobs.get(ALICE, job.id)
    assert ended.progress is not None
    assert outcome.summary is not None
    assert ended.progress["note"] == outcome.summary["note"] == SEARCH_RESTARTED
    assert outcome.summary["words"].endswith(f"Note: {SEARCH_RESTARTED}.")


@pytest.mark.ci
def test_checkpoint_of_a_newer_version_is_left_to_its_coordinators(
    store: Store, blobs: Blobs, job: Job
) -> None:
    path = interrupt(store, blobs)
    assert store.jobs.get(ALICE, job.id).versions["checkpoint"] == ISLANDS_VERSION
    path.write_bytes(b"another format")
    newer = update(jobs).values(checkpoint_version="999.0")
    store.database.write(lambda connection: connection.execute(newer))
    with pytest.raises(JobDeclinedError, match=r"islands 999\.0, which wrote the checkpoint"):
        run_identification_job(make_run(claim(store), store, blobs, lambda: None, 1e-9))


def find_checkpoints(blobs: Blobs, before: set[str]) -> set[str]:
    """Return the checkpoints that were added. Free runs of the best model so far are JSON."""
    added = set(dict(blobs.all())) - before
    return {each for each in added if not blobs.read(each).startswith(b"{")}


@pytest.mark.ci
def test_superseded_checkpoint_is_deleted_at_once(
    store: Store, blobs: Blobs, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "CHECKPOINT_SHARE", 1e9)
    before = set(dict(blobs.all()))
    seen = set()

    def look() -> None:
        named = store.jobs.get(ALICE, job.id).checkpoint
        seen.add(named)
        assert find_checkpoints(blobs, before) == ({named} if named else set())

    run_identification_job(make_run(claim(store), store, blobs, look, 1e-9))
    assert len(seen) > 5


@pytest.mark.ci
def test_lost_lease_deletes_no_checkpoint_of_its_successor(store: Store, blobs: Blobs, job: Job) -> None:
    interrupt(store, blobs)
    old, new = claim(store), claim(store)
    kept = store.jobs.get(ALICE, job.id).checkpoint
    with pytest.raises(LeaseLostError):
        run_identification_job(make_run(old, store, blobs, lambda: None, 1e-9))
    assert store.jobs.get(ALICE, job.id).checkpoint == kept == new.job.checkpoint
    assert kept in dict(blobs.all())


class Doubtful:
    """Leases of a store that loses the connection during some commits."""

    def __init__(self, store: Store) -> None:
        self._store, self.reports, self.leases = store, 0, self

    def report(self, *arguments: Any) -> Job:
        self.reports += 1
        if self.reports % 3 == 1:
            raise StoreUnavailableError("the database does not answer")
        reported = self._store.leases.report(*arguments)
        if self.reports % 3 == 2:
            raise CommitUnknownError("the connection was lost")
        return reported

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store, name)


@pytest.mark.ci
def test_named_checkpoint_exists_whatever_the_store_acknowledges(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "CHECKPOINT_SHARE", 1e9)
    before = set(dict(blobs.all()))
    kept = []

    def look() -> None:
        named = store.jobs.get(ALICE, job.id).checkpoint
        found = set(dict(blobs.all())) - before
        assert named is None or named in found
        kept.append(len(found))

    flaky: Any = Doubtful(store)
    outcome = run_identification_job(make_run(claim(store), flaky, blobs, look, 1e-9))
    assert [json.loads(json.dumps(document)) for document, _ in outcome.models] == undisturbed[0]
    assert 2 <= max(kept) <= 4
    assert flaky.reports > 10


class LostIslands(tuple[Island, ...]):
    """Islands that are lost while a checkpoint is written."""

    def render(self, function: Callable[[Island], bytes]) -> Iterator[bytes]:
        yield function(self[0])
        raise ClusterError("a machine was lost")


class LosingEngine(SerialEngine):
    """Engine that loses the islands of some epochs."""

    def run(self, *search: Any) -> Iterator[ArchipelagoEpoch]:
        for number, epoch in enumerate(super().run(*search)):
            lost = Archipelago(LostIslands(epoch.archipelago.islands))
            yield replace(epoch, archipelago=lost) if number in {0, 2, 3} else epoch


@pytest.mark.ci
def test_search_continues_without_a_checkpoint_whose_islands_were_lost(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "CHECKPOINT_SHARE", 1e9)
    named, before = set(), set(dict(blobs.all()))
    look = lambda: named.add(store.jobs.get(ALICE, job.id).checkpoint)  # noqa: E731
    run = replace(make_run(claim(store), store, blobs, look, 1e-9), engine=LosingEngine())
    outcome = run_identification_job(run)
    assert [json.loads(json.dumps(document)) for document, _ in outcome.models] == undisturbed[0]
    assert store.results.history(job.id) == undisturbed[1]
    assert len(named) > 5
    assert find_checkpoints(blobs, before) == {store.jobs.get(ALICE, job.id).checkpoint}


def test_checkpoint_that_cannot_be_read_now_is_not_lost(
    store: Store, blobs: Blobs, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise the search would start again for an interruption of a second."""
    checkpoint = blobs.write(b"")
    lease = claim(store)
    store.leases.report(lease, ProgressReport({}, checkpoint=checkpoint))

    def fail(_blob: str) -> IO[bytes]:
        raise ObjectStoreError("it does not answer")

    monkeypatch.setattr(blobs, "open", fail)
    with pytest.raises(ObjectStoreError):
        JobCheckpoints(store.jobs.get(ALICE, job.id), blobs).read()
