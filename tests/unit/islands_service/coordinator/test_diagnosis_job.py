"""Discrepancy jobs: fraction and time left, times of the checkpoints, result and report."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import structlog

from islands.diagnosis.inference import noise_floor
from islands.diagnosis.interim_findings import EXTENSION
from islands.errors import RecordError, SettingsError
from islands.facade.explain_residual import FORMULA
from islands_service.coordinator import diagnosis_job
from islands_service.coordinator.checkpoints import DiagnosisState
from islands_service.coordinator.diagnosis_job import DiagnosisProgress
from islands_service.coordinator.heartbeat import JobCancelled
from islands_service.coordinator.job_failures import make_problem_document
from islands_service.domain.job import EXTENDED, REPORT, Job, JobState
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.database import CommitUnknownError, StorageFullError, StoreUnavailableError
from support.command_line import write_offset
from support.diagnosis_jobs import claim, run_job, submit_diagnosis
from support.job_runs import make_run
from support.stores import ALICE, claimed, submitted
from support.undrawn import undrawn_figures

Submit = Callable[..., Job]
COLUMN, PIEZO = {"kind": "column", "column": "theirs_um"}, {"kind": "bouc-wen-piezo"}


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(diagnosis_job, "monotonic", lambda: now[0])
    return now


def test_fraction_and_time_left_follow_the_reports_of_a_step(store, clock):
    job = submitted(store)
    lease, state, seen = claimed(store), DiagnosisState(spent=3.0), []
    # Without new fits no checkpoint is written: the job would never be given up.
    report = DiagnosisProgress(make_run(lease, store, None, checkpoint_every=1e-9), None, state)

    def look():
        seen.append(store.jobs.get(ALICE, job.id).progress)

    report("calibrating", 0.0)
    look()
    for fraction in (0.3, 0.35, 0.4):
        report("with model error", fraction)
        look()
        clock[0] += 1.0
    report("no fraction is known")
    look()
    assert seen[0] == {"phase": "calibrating", "fraction": 0.0, "seconds_left": None}
    assert [each["fraction"] for each in seen[1:]] == [0.3, 0.35, 0.4, 0.4]
    expected = [3.0 * 0.7 / 0.3, 4.0 * 0.65 / 0.35, 5.0 * 0.6 / 0.4, 5.0 * 0.6 / 0.4 - 1.0]
    assert [each["seconds_left"] for each in seen[1:]] == pytest.approx(expected)


class Checkpoints:
    """Checkpoints whose writing takes some time or fails; they record what happens to them."""

    def __init__(self, clock):
        self.clock, self.takes, self.full, self.calls = clock, 0.0, False, []

    def write(self, state, _spent):
        if self.full:
            raise StorageFullError("the disk is full")
        self.clock[0] += self.takes
        return f"{state.journal.computed:064x}"

    def remember(self, blob):
        self.calls.append(("remember", int(blob, 16)))

    def supersede(self, blob):
        self.calls.append(("supersede", int(blob, 16)))


@pytest.fixture
def step(store, clock):
    """Make a fit, report a second later, and return the number of fits in the checkpoint of the job."""
    job, state, checkpoints = submitted(store), DiagnosisState(), Checkpoints(clock)
    reporting = SimpleNamespace(leases=store.leases)
    run = make_run(claimed(store), reporting, None, checkpoint_every=10.0)
    report = DiagnosisProgress(run, checkpoints, state)

    def step(seconds=1.0):
        clock[0] += seconds
        state.journal.computed += 1
        report("fits")
        stored = store.jobs.get(ALICE, job.id)
        return stored.checkpoint and int(stored.checkpoint, 16)

    step.checkpoints, step.reporting = checkpoints, reporting
    return step


def test_checkpoints_take_at_most_a_twentieth_of_the_time(step):
    assert [step() for _ in range(11)] == [1] * 10 + [11]
    step.checkpoints.takes = 2.0
    assert step(20.0) == 12
    assert [step(10.0) for _ in range(4)] == [12, 12, 12, 16]


def test_full_disk_delays_the_checkpoint_and_not_the_progress(step):
    step.checkpoints.full = True
    assert [step(), step(20.0)] == [None, None]
    step.checkpoints.full = False
    assert [step(), step(10.0)] == [None, 4]


def test_checkpoint_is_superseded_once_the_job_names_the_next_one(store, step):
    def report(lease, progress):
        store.leases.report(lease, progress)
        raise CommitUnknownError("the connection was lost")

    step.reporting.leases = SimpleNamespace(report=report)
    assert step() == 1
    step.reporting.leases = store.leases
    assert [step(), step(10.0)] == [1, 3]
    assert step.checkpoints.calls == [("remember", 1), ("supersede", 3)]


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with a temperature, and a column with a simulation that lacks an offset."""
    path = write_offset(tmp_path_factory.mktemp("offset") / "record.csv")
    header, *lines = path.read_text().splitlines()
    warmth = np.cumsum(np.random.default_rng(1).standard_normal(len(lines)))
    rows = [f"{line},{kelvin:.6f}" for line, kelvin in zip(lines, warmth, strict=True)]
    path.write_text("\n".join([f"{header},T_K", *rows]) + "\n")
    return path


@pytest.fixture(autouse=True)
def _cheap_analysis(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Render no figures, and use few random features in the search for residual structure."""
    monkeypatch.setattr(noise_floor, "RANDOM_FEATURES", 20)
    with undrawn_figures():
        yield


@pytest.fixture
def submit(store: Store, blobs: Blobs, measured: Path) -> Submit:
    """Submit jobs on the record that differs from its simulation by an offset."""
    return lambda **changes: submit_diagnosis(store, blobs, measured, **{"channels": ["T_K"], **changes})


def phases(store: Store, job: Job) -> list[str]:
    """Return the phases of a job; one with several reports counts once."""
    reported = [each.data["phase"] for each in store.jobs.events(job.id) if each.kind == "progress"]
    return [phase for phase, _ in groupby(reported)]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("phase", "verdict", "left_out"),
    [
        ("screening ", "stopped", "combinations of effects"),
        ("searching for missing terms", "named", "search for missing terms"),
        (FORMULA, "named", "report.html"),
    ],
)
def test_cancelled_job_keeps_what_its_diagnosis_has_found(
    store: Store, blobs: Blobs, submit: Submit, phase: str, verdict: str, left_out: str
) -> None:
    job = submit()

    def check() -> None:
        if any(reported.startswith(phase) for reported in phases(store, job)[-1:]):
            raise JobCancelled("cancelled")

    def checked_map(function: Callable[[Any], Any], arguments: Iterable[Any], /) -> Iterator[Any]:
        for argument in arguments:
            check()
            yield function(argument)

    lease = claim(store)
    outcome = run_job(lease, store, blobs, check, checked_map)
    store.leases.finish(lease, outcome)
    document, summary = outcome.document or {}, outcome.summary or {}
    assert (outcome.state, document["verdict"], summary["verdict"]) == (JobState.CANCELLED, verdict, verdict)
    assert left_out in document["left_out"]
    assert all(step in summary["words"] for step in document["left_out"])
    assert (EXTENDED in outcome.artefacts) == (verdict == "named")
    # The resumed job replaces the result.
    store.jobs.resume(ALICE, job.id)
    lease = claim(store)
    store.leases.finish(lease, run_job(lease, store, blobs))
    resumed = store.results.document(job.id) or {}
    assert (resumed["verdict"], resumed["left_out"]) == ("named", [])


@pytest.mark.ci
def test_last_attempt_ends_with_the_named_causes(store: Store, blobs: Blobs, submit: Submit) -> None:
    submit()
    complete = run_job(lease := claim(store), store, blobs)
    outcome = run_job(replace(lease, is_last=True), store, blobs)
    document = outcome.document or {}
    assert (outcome.state, document["left_out"]) == (JobState.SUCCEEDED, [])
    assert document["effects"] == (complete.document or {})["effects"]
    assert {each["step"] for each in document["not_computed"]} == {EXTENSION, FORMULA, REPORT}
    assert complete.artefacts.keys() - outcome.artefacts.keys() == {REPORT}


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"rows": "0:99"}, RecordError, "99 samples, and a diagnosis needs "),
        ({"simulation": PIEZO, "tolerance": {"mass": 0.1}}, SettingsError, "has no parameter 'mass'"),
        (
            {"simulation": {**PIEZO, "parameters": {"mass": 1.0}}},
            SettingsError,
            "there is no parameter mass",
        ),
    ],
)
def test_unusable_record_or_simulation_becomes_a_problem_of_the_job(
    store: Store, blobs: Blobs, submit: Submit, changes: dict[str, Any], kind: type, words: str
) -> None:
    submit(**changes)
    with pytest.raises(kind, match=words) as caught:
        run_job(claim(store), store, blobs)
    expected = {RecordError: "invalid-record", SettingsError: "invalid-settings"}[kind]
    assert make_problem_document(caught.value)["type"] == expected


class Away:
    """Leases of a store that is unavailable for reports."""

    def __init__(self, store: Store) -> None:
        self._store, self.leases = store, self

    def report(self, *_: object) -> None:
        raise StoreUnavailableError("the database does not answer")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store, name)


def test_finished_work_waits_for_an_object_store_that_is_away() -> None:
    failures = [ObjectStoreError("away")] * 3

    class Away:
        def write(self, data: bytes) -> str:
            if failures:
                raise failures.pop()
            return data.decode()

    with structlog.testing.capture_logs() as logs:
        assert diagnosis_job._keep(b"report", Away(), lambda: None, lambda _: None) == "report"  # type: ignore[arg-type]
    assert [entry["event"] for entry in logs] == ["cannot store yet", "stored"]

    def cancel() -> None:
        raise JobCancelled("cancelled")

    failures.append(ObjectStoreError("away"))
    with pytest.raises(JobCancelled):
        diagnosis_job._keep(b"report", Away(), cancel, lambda _: None)  # type: ignore[arg-type]
