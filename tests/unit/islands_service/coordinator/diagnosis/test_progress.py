"""`DiagnosisProgress`: fraction and time left of a diagnosis, and the times of its checkpoints."""

from types import SimpleNamespace

import pytest

from islands_service.coordinator.diagnosis import progress as diagnosis_progress
from islands_service.coordinator.diagnosis.checkpoints import DiagnosisState
from islands_service.coordinator.diagnosis.progress import DiagnosisProgress
from islands_service.store.database import CommitUnknownError, StorageFullError
from support.job_runs import make_run
from support.stores import ALICE, claimed, submitted


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(diagnosis_progress, "monotonic", lambda: now[0])
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
