"""Closed loops: feedback of the noise is found, and errors of the simulation are not feedback."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.gross_errors.closed_loop import acts_at_once, measure_feedback
from islands.diagnosis.inference.verdict import Verdict
from islands.records.dataset import Dataset
from support.simulated_records import recorded

SAMPLES = 600


def run_loop(gain: float, pole: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return input and output of a first-order plant under a proportional controller with a delay."""
    rng = np.random.default_rng(seed)
    setpoint = np.repeat(rng.standard_normal(SAMPLES // 20), 20)
    u, x, y, noise = np.zeros(SAMPLES), 0.0, np.zeros(SAMPLES), 0.0
    for k in range(1, SAMPLES):
        x = 0.9 * x + 0.1 * u[k - 1]
        noise = pole * noise + 0.05 * rng.standard_normal()
        y[k] = x + noise
        u[k] = setpoint[k] - gain * y[k]
    return u, y


def simulate(u: np.ndarray, a: float = 0.9, b: float = 0.1) -> np.ndarray:
    y = np.zeros(u.size)
    for k in range(1, u.size):
        y[k] = a * y[k - 1] + b * u[k - 1]
    return y


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_feedback_of_the_noise_is_found_and_its_absence_is_not(pole: float, seed: int) -> None:
    u, y = run_loop(2.0, pole, seed)
    feedback = measure_feedback(u, y - simulate(u), 0)
    assert feedback is not None
    assert feedback[0] == 0
    assert feedback[1] < -0.2
    u, y = run_loop(0.0, pole, seed)
    assert measure_feedback(u, y - simulate(u), 0) is None


def closed_loop_record() -> Dataset:
    return recorded(*run_loop(2.0, 0.0, 0))


def pass_on(u: np.ndarray, _dt: float) -> np.ndarray:
    return u


@pytest.mark.ci
def test_closed_loop_is_said_and_changes_no_verdict() -> None:
    def plant(u: np.ndarray, _dt: float, b: float = 0.1) -> np.ndarray:
        return simulate(u, b=b)

    found = islands.diagnose(closed_loop_record(), islands.function_simulator(plant), effects=())
    assert found.verdict != Verdict.GROSS_ERROR
    (finding,) = found.record_findings
    assert (finding.name, finding.errors) == ("closed-loop", None)
    assert not acts_at_once(found.base)
    at_once = replace(
        found.base,
        simulation=replace(found.base.simulation, simulator=islands.function_simulator(pass_on)),
        values=np.zeros(0),
        output=found.record.u[:, 0],
    )
    assert acts_at_once(at_once)


@pytest.mark.nightly
def test_errors_below_the_resolution_are_no_noise_that_is_fed_back() -> None:
    def plant(u: np.ndarray, _dt: float) -> np.ndarray:
        return simulate(u)

    def diagnose(error: float) -> islands.DiagnosisResult:
        record = recorded(u, simulate(u) + error * np.roll(u, -1))
        return islands.diagnose(record, islands.function_simulator(plant), effects=())

    u = np.random.default_rng(0).standard_normal(SAMPLES)
    assert [each.name for each in diagnose(1e-3).record_findings] == ["closed-loop"]
    assert not diagnose(1e-9).record_findings
