"""`DiagnosisProgress`: fraction and time left of a diagnosis, from its steps and the ended fits of a step."""

import pytest

from islands_service.coordinator.diagnosis import diagnosis_progress
from islands_service.coordinator.diagnosis.diagnosis_checkpoints import DiagnosisState
from islands_service.coordinator.diagnosis.diagnosis_progress import STEP, DiagnosisProgress
from support.stores import ALICE, claimed, submitted


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(diagnosis_progress, "monotonic", lambda: now[0])
    return now


def test_time_left_follows_the_fraction_of_steps_and_fits(store, clock):
    job = submitted(store)
    lease, state, seen = claimed(store), DiagnosisState(spent=3.0), []
    # Without new fits no checkpoint is written: the job would never be given up.
    report = DiagnosisProgress(lease, store, lambda: None, None, state, 1e-9)

    def look(_):
        clock[0] += 1.0
        seen.append(store.jobs.get(ALICE, job.id).progress)

    report("calibrating", 0.0)
    assert store.jobs.get(ALICE, job.id).progress == {
        "phase": "calibrating",
        "fraction": 0.0,
        "seconds_left": None,
    }
    report("screening 4 effects", 0.3)
    assert list(report.count(map)(look, range(4))) == [None] * 4
    assert [each["fraction"] for each in seen] == pytest.approx([0.3 + STEP * k / 4 for k in range(4)])
    assert seen[0] == {"phase": "screening 4 effects", "fraction": 0.3, "seconds_left": pytest.approx(7.0)}
    assert seen[1]["seconds_left"] == pytest.approx(4.0 * 0.65 / 0.35)
    report("no fraction is known")
    assert store.jobs.get(ALICE, job.id).progress["fraction"] == 0.3
