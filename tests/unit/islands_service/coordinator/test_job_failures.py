"""Failures of jobs: transient ones are tried again, others end the job, and no message contains a path."""

import errno
import json
from collections.abc import Callable
from threading import Thread

import pytest
from sqlalchemy import update

from islands.errors import IslandsError, RecordError, SettingsError
from islands_service.coordinator import main_loop as coordinator_module
from islands_service.coordinator.job_failures import describe_interruption
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import Job, JobOutcome, JobState, Submission
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.leases import ATTEMPTS
from islands_service.store.tables import jobs
from support.coordinators import DONE, replace_runner, wait_until_finished
from support.processes import eventually
from support.stores import ALICE, contents

pytestmark = pytest.mark.ci

Coordinators = Callable[..., Thread]


@pytest.mark.parametrize(
    ("error", "kind", "detail"),
    [
        (RecordError("line 7 is wrong"), "invalid-record", "line 7 is wrong"),
        (BlobNotFoundError("the blob is gone"), "no-such-blob", str(BlobNotFoundError.__doc__)),
        (IslandsError("something else"), "job-failed", "something else"),
        (ZeroDivisionError("by zero"), "defect", "ZeroDivisionError: the log of the service has"),
    ],
)
def test_failed_job_has_a_typed_problem_and_does_not_block_others(
    store: Store,
    job: Job,
    coordinator: Callable[..., Thread],
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    kind: str,
    detail: str,
) -> None:
    def fail_first(run: JobRun) -> JobOutcome:
        if run.job.id == job.id:
            raise error
        return DONE

    replace_runner(monkeypatch, fail_first)
    second = store.jobs.submit(Submission(ALICE, job.spec))[0]
    coordinator()
    failed = wait_until_finished(store, job)
    assert failed.state == JobState.FAILED
    assert failed.problem is not None
    assert failed.problem["type"] == kind
    assert failed.problem["detail"].startswith(detail)
    assert "Traceback" not in json.dumps(failed.problem)
    assert wait_until_finished(store, second).state == JobState.SUCCEEDED


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ESTALE, "Stale file handle", "/data/blobs/ab"),
        MemoryError(),
        ConnectionResetError(),
        ImportError("/data/lib.so: failed to map segment from shared object", path="/data/lib.so"),
    ],
)
def test_job_is_tried_again_after_a_transient_error(
    store: Store, job: Job, coordinator: Coordinators, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    failures = [error] * (ATTEMPTS - 1)

    def fail(_run: JobRun) -> JobOutcome:
        if failures:
            raise failures.pop()
        return DONE

    replace_runner(monkeypatch, fail)
    monkeypatch.setattr(coordinator_module, "RETRY_BACKOFF", 0.005)
    coordinator()
    ended = wait_until_finished(store, job)
    assert (ended.state, ended.attempt) == (JobState.SUCCEEDED, ATTEMPTS)
    notes = [event.data["note"] for event in store.jobs.events(job.id) if "note" in event.data]
    assert notes == [describe_interruption(error)] * (ATTEMPTS - 1)
    assert "/data" not in notes[0]


def test_repeated_transient_errors_fail_the_job_with_their_reason(
    store: Store, job: Job, coordinator: Coordinators, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_run: JobRun) -> JobOutcome:
        raise MemoryError

    replace_runner(monkeypatch, fail)
    monkeypatch.setattr(coordinator_module, "RETRY_BACKOFF", 0.005)
    coordinator()
    ended = wait_until_finished(store, job)
    assert (ended.state, ended.attempt) == (JobState.FAILED, ATTEMPTS)
    assert ended.problem is not None
    assert ended.problem["type"] == "no-progress"
    assert "(MemoryError)" in ended.problem["detail"]


def accepted_by(store: Store, version: str) -> None:
    """Change the version of islands that accepted all jobs."""
    store.database.write(lambda connection: connection.execute(update(jobs).values(islands_version=version)))


@pytest.mark.parametrize("error", [SettingsError("unknown"), RecordError("odd"), KeyError("kind")])
def test_job_of_a_newer_version_waits_for_a_coordinator_of_it(
    store: Store, job: Job, coordinator: Coordinators, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail_first(run: JobRun) -> JobOutcome:
        if run.job.id == job.id:
            raise error
        return DONE

    replace_runner(monkeypatch, fail_first)
    accepted_by(store, "999.1")
    thread = coordinator()
    eventually(lambda: len(store.jobs.events(job.id)) == 4)
    second = store.jobs.submit(Submission(ALICE, job.spec))[0]
    assert wait_until_finished(store, second).state == JobState.SUCCEEDED
    thread.stop()  # type: ignore[attr-defined]
    thread.join()
    waiting = store.jobs.get(ALICE, job.id)
    # It was claimed once, and other jobs are not delayed.
    assert (waiting.state, waiting.attempt, waiting.version) == (JobState.QUEUED, 0, 4)
    assert waiting.progress is not None
    assert "waiting for a coordinator of islands 999.1" in waiting.progress["note"]
    assert store.leases.claim("old", 60.0) is None
    lease = store.leases.claim("new", 60.0, "999.1")
    assert lease is not None
    assert lease.job.id == job.id


def test_job_of_this_version_fails_and_a_job_without_a_version_too(
    store: Store, job: Job, coordinator: Coordinators, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_run: JobRun) -> JobOutcome:
        raise SettingsError("unknown")

    replace_runner(monkeypatch, fail)
    accepted_by(store, "0.0.1")
    coordinator()
    assert wait_until_finished(store, job).state == JobState.FAILED


def damage(settings: ServiceSettings) -> None:
    """Replace all blobs by garbage."""
    for path in settings.blobs.glob("??/*"):
        path.write_bytes(b"garbage,\0\xff")


def remove(settings: ServiceSettings) -> None:
    for path in settings.blobs.glob("??/*"):
        path.unlink()


@pytest.mark.parametrize("kind", ["identification", "discrepancy", "unknown"])
@pytest.mark.parametrize("harm", [damage, remove, lambda _: None])
def test_no_message_of_a_failed_job_contains_a_path(
    store: Store,
    job: Job,
    settings: ServiceSettings,
    coordinator: Coordinators,
    kind: str,
    harm: Callable[[ServiceSettings], None],
) -> None:
    store.jobs.cancel(ALICE, job.id)
    part = {"dataset": job.spec["dataset"], "rows": "0:20"}
    spec = {
        "identification": {**job.spec, **part},
        "discrepancy": {**part, "input": "u_V", "output": "y_um", "simulation": {"kind": "bouc-wen-piezo"}},
    }.get(kind, {})
    failing = store.jobs.submit(Submission(ALICE, spec, kind))[0]
    harm(settings)
    coordinator()
    assert wait_until_finished(store, failing).state == JobState.FAILED
    said = json.dumps([contents(store)["jobs"], contents(store)["events"]])
    assert str(settings.data_dir) not in said
    assert "/tmp" not in said
