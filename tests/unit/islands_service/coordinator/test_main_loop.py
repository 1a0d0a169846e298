"""`Coordinator`: every job ends or is released, whatever error occurs."""

import os
import signal
import time
from collections.abc import Callable
from threading import Thread
from typing import Any, ClassVar

import pytest
import structlog

from islands_service.coordinator import main_loop as coordinator_module
from islands_service.coordinator import sweeper as sweeper_module
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import (
    Job,
    JobOutcome,
    JobState,
    Lease,
    Submission,
)
from islands_service.liveness import StopRequest
from islands_service.runtime import ClusterError
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StorageFullError, StoreUnavailableError
from islands_service.store.leases import ATTEMPTS, Leases
from support.coordinators import (
    DONE,
    RayCoordinator,
    SerialCoordinator,
    replace_runner,
    run_until_check_raises,
    wait_until_finished,
)
from support.processes import eventually
from support.stores import ALICE, child


def test_stopping_coordinator_releases_its_job_without_an_attempt(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_runner(monkeypatch, run_until_check_raises)
    thread = coordinator()
    eventually(lambda: store.jobs.get(ALICE, job.id).state == JobState.RUNNING)
    thread.stop()  # type: ignore[attr-defined]
    thread.join(5.0)
    back = store.jobs.get(ALICE, job.id)
    assert (back.state, back.attempt) == (JobState.QUEUED, 0)


def test_running_job_is_cancelled_on_request(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_runner(monkeypatch, run_until_check_raises)
    coordinator()
    eventually(lambda: store.jobs.get(ALICE, job.id).state == JobState.RUNNING)
    store.jobs.cancel(ALICE, job.id)
    assert wait_until_finished(store, job).state == JobState.CANCELLED


def test_job_with_a_lost_lease_is_left_to_its_new_owner(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = []

    def lose(run: JobRun) -> JobOutcome:
        if not gone:
            gone.append(store.leases.claim("me", 60.0))  # the same name may claim the job
            run_until_check_raises(run)
        return DONE

    replace_runner(monkeypatch, lose)
    coordinator()
    second = store.jobs.submit(Submission(ALICE, job.spec))[0]
    eventually(lambda: store.jobs.get(ALICE, second.id).state == JobState.SUCCEEDED)
    assert store.jobs.get(ALICE, job.id).state in (JobState.RUNNING, JobState.SUCCEEDED)
    assert gone[0].epoch == 2


class Full(SerialCoordinator):
    """A coordinator whose store is full for some attempts to store an outcome."""

    phases: ClassVar[list[str]] = []

    def run(self) -> None:
        finish = self._store.leases.finish
        self.tries = 0

        def full(lease: Lease, outcome: JobOutcome) -> None:
            self.tries += 1
            self.phases.append((self._store.jobs.get(ALICE, lease.job.id).progress or {}).get("phase", ""))
            if self.tries == 2:
                self._store.jobs.cancel(ALICE, lease.job.id)
            if self.tries < 8:
                raise StorageFullError("the disk is full")
            finish(lease, outcome)

        self._store.leases.finish = full  # type: ignore[method-assign]
        super().run()


def test_outcome_is_stored_as_soon_as_the_disk_has_space(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The job is not run again: it is one attempt, and a cancel request in the meantime is too late.

    Its phase is that of the wait, which is no run time.
    """
    replace_runner(monkeypatch, lambda _run: DONE)
    monkeypatch.setattr(coordinator_module, "RETRY_SECONDS", 0.2)
    began = time.monotonic()
    with structlog.testing.capture_logs() as logs:
        coordinator(Full)
        ended = wait_until_finished(store, job)
        eventually(lambda: any(entry["event"] == "job finished" for entry in logs))
    assert (ended.state, ended.attempt, ended.summary) == (JobState.SUCCEEDED, 1, {"done": True})
    assert set(Full.phases[1:]) == {"waiting for disk space"}
    assert ended.run_seconds < 0.5 * (time.monotonic() - began)
    logged = [entry["event"] for entry in logs if "finish" in entry["event"]]
    assert logged == ["cannot finish yet", "job can be finished", "job finished"]


def test_unavailable_store_during_a_job_is_not_an_attempt(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    away = [7]  # more often than a job may fail

    def work(_run: JobRun) -> JobOutcome:
        if away[0]:
            away[0] -= 1
            raise StoreUnavailableError("the database does not answer")
        return DONE

    monkeypatch.setattr("islands_service.coordinator.main_loop.RETRY_SECONDS", 0.01)
    replace_runner(monkeypatch, work)
    coordinator()
    ended = wait_until_finished(store, job)
    assert (ended.state, ended.attempt) == (JobState.SUCCEEDED, 1)


def test_lost_cluster_ends_the_coordinator_and_is_an_attempt(
    store: Store, job: Job, settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(_run: JobRun) -> JobOutcome:
        raise ClusterError("no more")

    replace_runner(monkeypatch, lost)
    doomed = SerialCoordinator(settings, "me", StopRequest())
    doomed._connected = True
    with pytest.raises(ClusterError, match="no more"):
        doomed.run()
    back = store.jobs.get(ALICE, job.id)
    assert (back.state, back.attempt) == (JobState.QUEUED, 1)


@pytest.mark.ci
def test_unreferenced_blobs_are_swept_after_an_hour(
    store: Store, blobs: Blobs, job: Job, coordinator: Callable[..., Thread]
) -> None:
    young, old = blobs.write(b"young"), blobs.write(b"old")
    named = store.datasets.get(ALICE, str(job.spec["dataset"])).blob
    for blob in (old, named):
        os.utime(blobs.path(blob), (1e9, 1e9))
    coordinator()
    wait_until_finished(store, job)

    def swept() -> bool:
        return old not in {blob for blob, _ in blobs.all()}

    eventually(swept, seconds=30.0)
    assert {young, named} <= {blob for blob, _ in blobs.all()}


def test_blob_referenced_during_a_sweep_is_kept(
    store: Store, blobs: Blobs, settings: ServiceSettings, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A coordinator may be suspended between two steps of a sweep for longer than the age limit."""
    monkeypatch.setattr(sweeper_module, "ORPHAN_AGE", 0.1)
    named_blobs = store.retention.named_blobs
    written: list[str] = []

    def slow_named_blobs() -> frozenset[str]:
        named = named_blobs()
        written.append(blobs.write(b"named meanwhile"))
        time.sleep(0.3)
        return named

    monkeypatch.setattr(store.retention, "named_blobs", slow_named_blobs)
    sweeper_module.Sweeper(settings, store, blobs, -1.0).sweep_if_due()
    assert blobs.read(written[0]) == b"named meanwhile"


def test_wait_for_ray_counts_as_an_attempt_if_it_ends(
    store: Store, job: Job, coordinator: Callable[..., Thread]
) -> None:
    thread = coordinator(RayCoordinator)
    eventually(lambda: "waiting for Ray" in str(store.jobs.get(ALICE, job.id).progress))
    thread.stop()  # type: ignore[attr-defined]
    thread.join(10.0)
    released = store.jobs.get(ALICE, job.id)
    assert (released.state, released.attempt) == (JobState.QUEUED, 0)
    lease = store.leases.claim("another", 60.0)
    assert lease is not None
    store.leases.count_attempt(lease, ATTEMPTS - 1)
    store.leases.release(lease, attempted=True)
    assert store.leases.claim("another", 60.0) is None  # given up


def test_idle_coordinator_attempts_a_claim_only_after_a_change(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_runner(monkeypatch, lambda _: DONE)
    monkeypatch.setattr(coordinator_module, "CLAIM_SECONDS", 600.0)
    claims, claim = [], Leases.claim

    def count(leases: Leases, *arguments: Any, **quotas: Any) -> Any:
        claims.append(time.monotonic())
        return claim(leases, *arguments, **quotas)

    monkeypatch.setattr(Leases, "claim", count)
    coordinator()
    wait_until_finished(store, job)
    time.sleep(1.0)
    before = len(claims)
    time.sleep(1.0)
    assert len(claims) == before
    second = store.jobs.submit(Submission(ALICE, job.spec))[0]
    assert wait_until_finished(store, second).state == JobState.SUCCEEDED


def test_idle_coordinator_ends_after_jobs_and_not_before_one(
    store: Store, job: Job, coordinator: Callable[..., Thread], monkeypatch: pytest.MonkeyPatch
) -> None:
    replace_runner(monkeypatch, lambda _: DONE)
    monkeypatch.setattr(coordinator_module, "IDLE_SECONDS", 0.3)
    store.jobs.cancel(ALICE, job.id)
    thread = coordinator()
    thread.join(1.5)
    assert thread.is_alive()
    second = store.jobs.submit(Submission(ALICE, job.spec))[0]
    assert wait_until_finished(store, second).state == JobState.SUCCEEDED
    thread.join(10.0)
    assert not thread.is_alive()


#: A coordinator with short pauses that reports its starts.
RESTARTING = """
import sys
from islands_service.coordinator import __main__ as program, main_loop
main_loop.IDLE_SECONDS = 0.3
print("started", flush=True)
sys.exit(program.main())
"""


@pytest.mark.nightly
def test_coordinator_continues_in_a_new_process_after_jobs(
    store: Store, job: Job, settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ISLANDS_DATA_DIR", str(settings.data_dir))
    with child(RESTARTING) as process:
        assert process.stdout is not None
        for each in (job, store.jobs.submit(Submission(ALICE, job.spec))[0]):
            assert wait_until_finished(store, each).state == JobState.SUCCEEDED
        said = [process.stdout.readline() for _ in range(2)]
        third = store.jobs.submit(Submission(ALICE, job.spec))[0]
        assert wait_until_finished(store, third).state == JobState.SUCCEEDED
        process.terminate()
        assert process.wait(20.0) in (0, -signal.SIGTERM)
    assert said == ["started\n"] * 2


HANGING = """
import sys, time
from pathlib import Path
from islands_service.liveness import StopRequest
from islands_service.coordinator import heartbeat
from islands_service.coordinator.main_loop import Coordinator
from islands_service.coordinator.job_run import JobRun
from islands_service.settings import ServiceSettings
heartbeat.HANG_TIMEOUT = 0.3
class Engine:
    def run(self, problem, start, stop):
        stop()
        time.sleep(60)
        yield
class SerialCoordinator(Coordinator):
    def _make_engine(self, *_): return Engine()
SerialCoordinator(ServiceSettings(data_dir=Path(sys.argv[1]), lease=1.0), "hanging", StopRequest()).run()
"""


@pytest.mark.ci
def test_coordinator_with_a_hanging_search_exits_and_the_job_continues(
    store: Store, job: Job, settings: ServiceSettings, coordinator: Callable[..., Thread]
) -> None:
    with child(HANGING, str(settings.data_dir)) as hanging:
        said, _ = hanging.communicate(timeout=60)
    assert ("search hangs" in said, hanging.returncode) == (True, 1)
    coordinator(name="hanging")
    ended = wait_until_finished(store, job)
    assert (ended.state, ended.attempt) == (JobState.SUCCEEDED, 2)
