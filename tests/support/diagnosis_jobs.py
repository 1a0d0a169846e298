"""Discrepancy jobs in this process: a record is uploaded, and its diagnosis runs without Ray."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from islands.parallel import ParallelMap
from islands.records.reading.preview import preview
from islands_service.coordinator.diagnosis_job import run_diagnosis_job
from islands_service.domain.job import DISCREPANCY, Job, JobOutcome, Lease, Submission
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service import held
from support.stores import ALICE

#: The column ``theirs_um`` of the record as the simulation.
COLUMN = {"kind": "column", "column": "theirs_um"}


def submit_diagnosis(store: Store, blobs: Blobs, path: Path, **changes: Any) -> Job:
    """Store a record with the columns ``u_V``, ``y_um`` and ``theirs_um``, and submit its diagnosis."""
    data, described = path.read_bytes(), asdict(preview(path))
    dataset, _ = store.datasets.add(ALICE, path.name, path.suffix, blobs.write(data), len(data), described)
    spec = held(dataset.id, **{"simulation": COLUMN, **changes})
    return store.jobs.submit(Submission(ALICE, spec, DISCREPANCY))[0]


def claim(store: Store) -> Lease:
    lease = store.leases.claim("me", 60.0)
    assert lease is not None
    return lease


def run_job(
    lease: Lease,
    store: Any,
    blobs: Blobs,
    check: Callable[[], None] = lambda: None,
    fits: ParallelMap = map,
    every: float = 1.0,
) -> JobOutcome:
    return run_diagnosis_job(make_run(lease, store, blobs, check, every), map_cases=fits)


def without_time(outcome: JobOutcome) -> JobOutcome:
    document, summary = dict(outcome.document or {}), dict(outcome.summary or {})
    assert document.pop("wall_s") == summary.pop("wall_s") > 0.0
    return replace(outcome, document=document, summary=summary)
