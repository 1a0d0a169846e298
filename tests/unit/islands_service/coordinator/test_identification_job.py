"""Identification job: progress, checkpoints, result, and continuation after interruptions."""

import json
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import pytest
import structlog

from islands.report.documents.result_folder import result_document
from islands.report.text.statements import describe
from islands_service.coordinator import identification_job as work
from islands_service.coordinator.heartbeat import CoordinatorStopping, JobCancelled, RunTimeLimitError
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import (
    SEARCH_FREE_RUN,
    Job,
    JobOutcome,
    JobState,
    Lease,
    LeaseLostError,
    Submission,
)
from islands_service.figure_worker import read_search_result
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreUnavailableError
from support.job_runs import Interruption, make_run
from support.stores import ALICE

Found = tuple[list[Any], list[Any]]


def claim(store: Store, name: str = "me") -> Lease:
    lease = store.leases.claim(name, 60.0)
    assert lease is not None
    return lease


def run_job(
    lease: Lease, store: Any, blobs: Any, check: Callable[[], None] = lambda: None, every: float = 1e-9
) -> JobOutcome:
    return run_identification_job(make_run(lease, store, blobs, check, every))


def get_models(outcome: JobOutcome) -> list[Any]:
    return [json.loads(json.dumps(document)) for document, _ in outcome.models]


@pytest.mark.ci
def test_job_finds_the_models_of_a_single_process(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found
) -> None:
    lease = claim(store)
    outcome = run_job(lease, store, blobs)
    assert outcome.state == JobState.SUCCEEDED
    assert get_models(outcome) == undisturbed[0]
    store.leases.finish(lease, outcome)
    assert [model.document for model in store.results.models(job.id)] == undisturbed[0]
    ended = store.jobs.get(ALICE, job.id)
    assert ended.summary is not None
    assert ended.summary["models"] == len(undisturbed[0])
    assert ended.progress is not None
    assert ended.progress["generation"] == ended.progress["generations"]
    drawn = read_search_result(ended, store, blobs, None)
    errors = [asdict(entry.metrics["validation"]["multiple_shooting"]) for entry in drawn.models]
    assert errors == [model["metrics"]["validation"]["multiple_shooting"] for model in undisturbed[0]]
    # The report states what the summary of the job states.
    words = ended.summary["words"].splitlines()
    assert len(words) > 5
    assert describe(result_document(drawn)) == words


@pytest.mark.ci
def test_free_run_of_the_best_model_is_stored_while_the_job_searches(
    store: Store, blobs: Blobs, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    monkeypatch.setattr("islands_service.coordinator.identification_job.FREE_RUN_EVERY", 0.0)
    monkeypatch.setattr("islands_service.coordinator.search_view._SHARE", 1e9)
    seen = dict[int, int]()

    def look() -> None:
        progress = store.jobs.get(ALICE, job.id).progress or {}
        if "free_run" in progress:
            blob = store.results.artefact(job.id, SEARCH_FREE_RUN)
            assert blob is not None
            document = json.loads(blobs.read(blob))
            stated = {name: document[name] for name in ("size", "generation")}
            assert (document["job"], stated) == (job.id, progress["free_run"])
            errors = {each["size"]: each["error"] for each in progress["front"]}
            assert document["error"] == errors[document["size"]]
            seen[document["generation"]] = len(set(dict(blobs.all())))

    lease = claim(store)
    outcome = run_job(lease, store, blobs, look, every=600.0)
    assert len(seen) > 3
    # Replaced free runs are deleted.
    assert max(seen.values()) <= 5
    store.leases.finish(lease, outcome)
    assert store.results.artefact(job.id, SEARCH_FREE_RUN) is None


@pytest.mark.ci
def test_interrupted_job_ends_with_the_same_models_and_history(
    store: Store,
    blobs: Blobs,
    job: Job,
    undisturbed: Found,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    for at in (0, 1, 2, 9, 25):
        lease = claim(store)
        with pytest.raises(CoordinatorStopping):
            run_job(lease, store, blobs, Interruption(store, job, at))
        store.leases.release(lease)
    lease = claim(store)
    assert lease.job.progress is not None
    assert lease.job.progress["generation"] >= 25
    outcome = run_job(lease, store, blobs)
    assert get_models(outcome) == undisturbed[0]
    assert store.results.history(job.id) == undisturbed[1]


@pytest.mark.ci
def test_cancelled_job_keeps_the_models_of_its_last_generation(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    lease = claim(store)
    outcome = run_job(lease, store, blobs, Interruption(store, job, 2, JobCancelled))
    assert outcome.state == JobState.CANCELLED
    assert outcome.document is not None
    search = outcome.document["search"]
    assert (search["generations"], search["ended_by"]) == (2, "stopped")
    assert {"search from generation 2 to 30", "prediction bands"} <= set(search["left_out"])
    store.leases.finish(lease, outcome)
    ended = store.jobs.get(ALICE, job.id)
    assert ended.state == JobState.CANCELLED
    assert len(store.results.models(job.id)) == len(outcome.models) > 0
    assert read_search_result(ended, store, blobs, None).models
    # The resumed job replaces them by those of a job that was never cancelled.
    store.jobs.resume(ALICE, job.id)
    assert get_models(run_job(claim(store), store, blobs)) == undisturbed[0]


@pytest.mark.nightly
def test_job_that_is_cancelled_at_any_check_ends_at_the_next_one(
    store: Store, blobs: Blobs, job: Job
) -> None:
    """The check stays true. A few steps follow, so that every size has a model."""
    changed = store.jobs.submit(Submission(ALICE, {**job.spec, "preset": "auto"}))[0]
    store.jobs.cancel(ALICE, job.id)
    lease = claim(store)
    assert lease.job.id == changed.id
    checks: list[None] = []
    run_job(lease, store, blobs, lambda: checks.append(None))
    total, kept = len(checks), [0]
    for percent in (0, 30, 70, 99):
        checks.clear()

        def check(percent: int = percent) -> None:
            checks.append(None)
            if len(checks) > percent * total // 100:
                raise JobCancelled("enough")

        try:
            outcome = run_job(lease, store, blobs, check)
        except JobCancelled:
            kept.append(0)
        else:
            assert outcome.state == JobState.CANCELLED
            kept.append(len(outcome.models))
        assert len(checks) < percent * total // 100 + 200
    assert kept[1] == 0
    assert kept[-1] > 1
    assert sorted(kept, key=bool) == kept  # once there are models, none are lost


@pytest.mark.ci
def test_search_at_its_limit_of_run_time_ends_with_its_models(
    store: Store, blobs: Blobs, job: Job, undisturbed: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    interruption = Interruption(store, job, 3)

    def check() -> None:
        try:
            interruption()
        except CoordinatorStopping:
            raise RunTimeLimitError(10) from None

    outcome = run_job(claim(store), store, blobs, check)
    assert outcome.state == JobState.SUCCEEDED
    assert outcome.models
    assert outcome.summary is not None
    assert outcome.summary["ended_by"] == "run time"
    assert "limit of the run time of one job, 10 s" in outcome.summary["words"]
    assert outcome.document is not None
    assert outcome.document["search"]["evaluations"] < undisturbed[1][-1][1]


@pytest.mark.ci
@pytest.mark.parametrize("at", [-1, 4])
def test_stopped_search_gives_the_models_of_one_that_ends_there(
    store: Store, blobs: Blobs, job: Job, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)

    def is_stopped() -> bool:
        progress = store.jobs.get(ALICE, job.id).progress or {}
        return progress.get("generation", -1) >= at

    outcome = run_identification_job(make_run(claim(store), store, blobs, is_search_stopped=is_stopped))
    assert outcome.state == JobState.SUCCEEDED
    assert outcome.document is not None
    assert outcome.summary is not None
    search, last = outcome.document["search"], max(0, at)
    # The first populations are evaluated in any case.
    assert (search["generations"], search["ended_by"]) == (last, "stopped by its owner")
    assert search["left_out"] == [f"search from generation {last} to 30"]
    assert f"search from generation {last} to 30" in outcome.summary["note"]
    assert outcome.summary["ended_by"] == "stopped by its owner"
    settings = {**job.spec["settings"], "generations": last}
    short = store.jobs.submit(Submission(ALICE, {**job.spec, "settings": settings}))[0]
    lease = claim(store, "another")
    assert lease.job.id == short.id
    assert get_models(run_job(lease, store, blobs)) == get_models(outcome)


def test_first_populations_are_stored_in_a_checkpoint_at_once(store: Store, blobs: Blobs, job: Job) -> None:
    """Otherwise a job that soon ends its coordinator would never make progress."""
    with pytest.raises(CoordinatorStopping):
        run_identification_job(make_run(claim(store), store, blobs, Interruption(store, job, 0), 3600.0))
    assert store.jobs.get(ALICE, job.id).checkpoint is not None


class Flaky:
    """Leases of a store that is unavailable for some of the reports."""

    def __init__(self, store: Store, fails: Callable[[int], bool]) -> None:
        self._store, self._fails, self.reports = store, fails, 0
        self.leases = self

    def report(self, *arguments: Any) -> Job:
        self.reports += 1
        if self._fails(self.reports):
            raise StoreUnavailableError("the database does not answer")
        return self._store.leases.report(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store, name)


@pytest.mark.ci
def test_failed_reports_do_not_affect_the_result(
    store: Store,
    blobs: Blobs,
    job: Job,
    undisturbed: Found,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    # The failing reports include the last ones.
    flaky = Flaky(store, lambda number: number % 3 != 0 or 30 < number < 36)
    with structlog.testing.capture_logs() as logs:
        outcome = run_job(claim(store), flaky, blobs)
    assert flaky.reports > 9
    # The phase before the search, then the search, whose later failures are within a minute.
    assert [entry["event"] for entry in logs if "report" in entry["event"]] == [
        "report failed",
        "report failed",
        "reports stored again",
    ]
    assert get_models(outcome) == undisturbed[0]
    assert store.results.history(job.id) == undisturbed[1]


def test_job_with_a_lost_lease_stops_at_its_next_report(store: Store, blobs: Blobs, job: Job) -> None:
    old = store.leases.claim("me", 60.0)
    assert old is not None
    new = claim(store)  # the same name: the previous process must have ended
    with pytest.raises(LeaseLostError):
        run_job(old, store, blobs)
    assert store.jobs.get(ALICE, job.id).version == new.job.version
    assert store.jobs.get(ALICE, job.id).checkpoint is None
