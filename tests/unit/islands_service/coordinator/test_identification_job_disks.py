"""Identification job whose disk is full or read-only for a while."""

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from islands_service.coordinator import identification_job as work
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import Job
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.disks import filled, read_only
from support.job_runs import make_run
from support.stores import ALICE

#: Checks of a search after which its disk fails, and after which it is repaired.
FAILS, REPAIRED = 60, 120


@pytest.fixture
def disk(small_disk: Callable[[int], Path]) -> Path:
    return small_disk(4_000_000)


@pytest.fixture
def blobs(disk: Path) -> Blobs:
    return Blobs(disk)


@contextmanager
def full(disk: Path) -> Iterator[None]:
    filler = filled(disk)
    yield
    filler.unlink()


@pytest.mark.ci
@pytest.mark.parametrize("fault", [full, read_only])
def test_search_continues_without_checkpoints_while_its_disk_fails(
    store: Store,
    blobs: Blobs,
    disk: Path,
    job: Job,
    undisturbed: tuple[list[Any], list[Any]],
    monkeypatch: pytest.MonkeyPatch,
    fault: Callable[[Path], AbstractContextManager[None]],
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(work, "CHECKPOINT_SHARE", 1e9)
    lease = store.leases.claim("me", 60.0)
    assert lease is not None
    checks, checkpoints, failure = [], [], ExitStack()

    def check() -> None:
        checks.append(1)
        if len(checks) == FAILS:
            failure.enter_context(fault(disk))
        if len(checks) in (FAILS, REPAIRED):
            checkpoints.append(store.jobs.get(ALICE, job.id).checkpoint)
        if len(checks) == REPAIRED:
            failure.close()

    with failure:
        outcome = run_identification_job(make_run(lease, store, blobs, check, 1e-9))
    found = [json.loads(json.dumps(document)) for document, _ in outcome.models]
    assert found == undisturbed[0]
    assert store.results.history(job.id) == undisturbed[1]
    last = store.jobs.get(ALICE, job.id).checkpoint
    assert checkpoints[0] == checkpoints[1] != last
    assert [blob for blob, _ in blobs.all() if blob == last]
