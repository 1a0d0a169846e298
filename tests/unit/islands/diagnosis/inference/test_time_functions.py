"""Functions of the time that a recording for validation contradicts."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.time_functions import leave_out_contradicted_time
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from islands.records.split import hold_out
from islands.report.documents.diagnosis_json import diagnosis_document
from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.statements import describe_details
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.specification.factory import make_simulator

DT, SAMPLES, NOISE = 0.1, 600, 0.02

TIME = DT * np.arange(SAMPLES)


def simulate_lag(u: np.ndarray) -> np.ndarray:
    y = np.zeros(u.size)
    for k in range(1, u.size):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    return y


def make_recording(seed: int, added: np.ndarray | float = 0.0, limit: float = np.inf) -> Dataset:
    """Return a recording of a first-order lag whose input has a limit, with a function of time and noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, SAMPLES // 12), 12)
    y = simulate_lag(np.clip(u, -limit, limit)) + added + NOISE * rng.standard_normal(SAMPLES)
    return Dataset(u, y, DT, ("u_V",), "y_um", ("V",), "um")


def calibrate_lag(
    record: Dataset, function: Callable[..., np.ndarray], effects: Sequence[Effect] = ()
) -> tuple[CalibrationResult, Target]:
    """Calibrate a function of the input with effects."""
    fitted, simulator = count_fitted_samples(record), PythonFunctionSimulator(function, "lag")
    simulation = ExtendedSimulator(simulator, effects, make_context(record, simulator, fitted))
    target = make_target(record, fitted, {})
    return calibrate(simulation, target, simulation.nominal), target


def leave_out(record: Dataset) -> tuple[CalibrationResult, CalibrationResult]:
    def simulate(u: np.ndarray, dt: float, gain: float = 1.0) -> np.ndarray:
        return gain * simulate_lag(u) + 0.0 * dt

    fit, target = calibrate_lag(record, simulate, (CATALOGUE["linear-drift"],))
    return fit, leave_out_contradicted_time(record, fit, target, np.random.default_rng(0))


def test_a_drift_that_goes_on_remains() -> None:
    drift = 0.5 * TIME / TIME[-1]
    fit, found = leave_out(hold_out(make_recording(1, drift), make_recording(2, 0.5 + drift)))
    assert found is fit


def test_terms_of_the_time_are_left_out_by_their_coefficients() -> None:
    def simulate(u: np.ndarray, dt: float, gain: float = 1.0, a1: float = 0.02) -> np.ndarray:
        return gain * simulate_lag(u) + a1 * dt * np.arange(u.size)

    record = hold_out(make_recording(1, 0.01 * TIME), make_recording(2))
    fit, target = calibrate_lag(record, simulate)
    rng = np.random.default_rng(0)
    assert leave_out_contradicted_time(record, fit, target, rng) is fit
    found = leave_out_contradicted_time(record, fit, target, rng, ["a1"])
    gain, slope = fit.values
    assert slope == pytest.approx(0.01, rel=0.01)
    assert found.output[:SAMPLES] == pytest.approx(fit.output[:SAMPLES], abs=0.0)
    assert found.output[SAMPLES:] == pytest.approx(gain * simulate_lag(record.u[SAMPLES:, 0]), abs=1e-12)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "first", "second"),
    [
        ("periodic-disturbance", 0.2 * np.sin(2.3 * TIME + 0.4), 0.2 * np.sin(2.3 * TIME + 2.9)),
        ("linear-drift", 0.5 * TIME / TIME[-1], 0.0),
    ],
)
def test_causes_with_another_time_in_validation_data_are_named(
    name: str, first: np.ndarray, second: np.ndarray | float
) -> None:
    given = hold_out(make_recording(1, first, limit=0.8), make_recording(2, second, limit=0.8))
    found = diagnose(given, make_simulator("linear:1", given))
    assert found.verdict == Verdict.NAMED
    assert set(found.claimed_names) == {"input-saturation", name}
    assert found.is_time_left_out
    assert found.gain is not None
    assert found.gain.ci95[0] > 0.0
    text = " ".join(describe_details(DiagnosisFacts(diagnosis_document(found))))
    assert "It contradicts the validation recording" in text
    assert "They belong to functions of the time, and are those of one recording." in text
