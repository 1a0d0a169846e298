"""Monitoring job: states that cannot be read, deleted monitors, and interruption, without an analysis."""

from dataclasses import replace
from typing import Any

import pytest

from islands.errors import RecordError, SettingsError
from islands_service.coordinator import job_failures, monitoring_job
from islands_service.coordinator.heartbeat import JobCancelled
from islands_service.coordinator.job_failures import JobDeclinedError
from islands_service.coordinator.monitoring_job import run_monitoring_job
from islands_service.domain.job import MONITORING, JobOutcome, JobState, Lease, Submission
from islands_service.domain.monitoring import Monitor, MonitorNotFoundError
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.monitor_updates import make_update
from support.service import held, kept
from support.stores import ALICE, claimed, contents


@pytest.fixture
def monitor(store: Store) -> Monitor:
    spec = {name: value for name, value in held("").items() if name != "dataset"}
    return store.monitors.create(ALICE, "press", spec, 0, 9)


@pytest.fixture
def lease(store: Store, monitor: Monitor) -> Lease:
    """Lease of the job of a record."""
    return add(store, monitor)


def add(store: Store, monitor: Monitor) -> Lease:
    spec = {"monitor": monitor.id, "dataset": kept(store, ALICE)}
    store.jobs.submit(Submission(ALICE, spec, MONITORING, monitor=monitor.id))
    return claimed(store)


def run(lease: Lease, store: Store, blobs: Blobs, check: Any = lambda: None) -> JobOutcome:
    return run_monitoring_job(make_run(lease, store, blobs, check))  # type: ignore[arg-type]


def refuse(*_: Any) -> Any:
    raise RecordError("the record is too short")


def test_a_first_record_that_cannot_be_used_leaves_the_monitor_waiting(
    store: Store, blobs: Blobs, monitor: Monitor, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monitoring_job, "read_record_and_columns", refuse)
    outcome = run(lease, store, blobs)
    assert (outcome.state, outcome.monitor) == (JobState.FAILED, None)
    assert outcome.problem is not None
    assert (outcome.problem["type"], outcome.problem["detail"]) == (
        "invalid-record",
        "the record is too short",
    )
    store.leases.finish(lease, outcome)
    assert store.monitors.get(ALICE, monitor.id).status == "waiting"


def test_a_job_that_is_cancelled_changes_nothing(
    store: Store, blobs: Blobs, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cancel() -> None:
        raise JobCancelled("it is cancelled")

    monkeypatch.setattr(monitoring_job, "read_record_and_columns", lambda *_: (None, {}))
    before = contents(store)["monitors"]
    with pytest.raises(JobCancelled):
        run(lease, store, blobs, cancel)
    assert contents(store)["monitors"] == before


def test_a_record_of_a_deleted_monitor_fails(
    store: Store, blobs: Blobs, monitor: Monitor, lease: Lease
) -> None:
    store.monitors.delete(ALICE, monitor.id)
    with pytest.raises(MonitorNotFoundError):
        run(lease, store, blobs)


def test_a_state_of_a_newer_version_waits_for_its_coordinator(
    store: Store, blobs: Blobs, monitor: Monitor, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    update = replace(make_update(monitor, [0]), head='{"schema": "new"}')
    store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {}, monitor=update))
    lease = add(store, monitor)
    with pytest.raises(SettingsError, match="is not the state of a monitor of this version"):
        run(lease, store, blobs)
    monkeypatch.setattr(job_failures, "ISLANDS_VERSION", "0.0.1")
    with pytest.raises(JobDeclinedError, match="which wrote the monitor"):
        run(lease, store, blobs)
