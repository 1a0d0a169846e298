"""Feedback within a sample is distinguished from a direct term, which it holds at zero."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.closed_loop import acts_at_once
from islands.diagnosis.inference.direct_feedback import hold_direct_term, list_late_effects
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.output_equation import add_output_equation
from islands.simulators.specification.factory import make_simulator
from support.noise_records import DT, SAMPLES, draw_input, make_loop, make_noisy_record
from support.simulated_records import recorded


def plant(u: np.ndarray, _dt: float, a: float = 0.95, b: float = 0.05) -> np.ndarray:
    y = np.full(u.size, 5.0)
    for k in range(1, u.size):
        y[k] = a * y[k - 1] + b * u[k - 1]
    return y


def fit(record: Dataset, simulation: str = "linear:1") -> tuple[CalibrationResult, Target]:
    fitted = count_fitted_samples(record)
    target = make_target(record, fitted, {})
    simulator = make_simulator(simulation, record)
    context = make_context(record, simulator, fitted)
    extended = ExtendedSimulator(add_output_equation(simulator, context), (), context)
    return calibrate(extended, target, extended.nominal), target


def get_values(found: CalibrationResult) -> dict[str, float]:
    names = [each.name for each in found.simulation.parameters]
    return dict(zip(names, found.values.tolist(), strict=True))


@pytest.mark.parametrize("seed", range(9100, 9105))
def test_simulation_without_a_direct_term_is_right_in_a_loop(seed: int) -> None:
    base, target = fit(make_loop(seed))
    held = hold_direct_term(base, target)
    assert held is not None
    assert not acts_at_once(held)
    assert "b0" not in get_values(held)
    assert abs(get_values(held)["b1"] - 0.05) < 0.001
    assert abs(get_values(base)["b1"] - 0.05) > 0.004


def respond_at_once(direct: float) -> Callable[[int], Dataset]:
    def make(seed: int) -> Dataset:
        rng = np.random.default_rng(seed)
        u = draw_input(rng)
        y = lfilter([direct, 0.1], [1.0, -0.9], u)
        return recorded(u, y + 0.05 * y.std() * rng.standard_normal(SAMPLES), DT)

    return make


@pytest.mark.parametrize(
    "make",
    [
        respond_at_once(0.05),
        respond_at_once(-0.05),
        respond_at_once(0.0),
        lambda seed: make_noisy_record("in band", seed),
        # A plant that responds at once, in a loop: without its direct term the simulation would be wrong.
        lambda seed: make_loop(seed, direct=0.05),
    ],
    ids=["direct", "inverse", "late", "coloured noise", "direct in a loop"],
)
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_held_without_feedback_or_with_a_direct_term(
    make: Callable[[int], Dataset], seed: int
) -> None:
    assert hold_direct_term(*fit(make(seed))) is None


def test_effects_on_the_output_of_the_same_sample_are_left_out() -> None:
    base, _ = fit(make_loop(9100))
    effects = [CATALOGUE[name] for name in ("viscous", "coulomb-friction", "offset", "input-saturation")]
    assert [each.name for each in list_late_effects(effects, base)] == ["offset", "input-saturation"]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("simulation", "seed"),
    [("linear:1", 9110), ("linear:1:1", 9111), (islands.function_simulator(plant), 9112)],
)
def test_clean_loop_within_a_sample_has_no_discrepancy(simulation: object, seed: int) -> None:
    found = islands.diagnose(make_loop(seed), simulation)  # type: ignore[arg-type]
    assert found.verdict == Verdict.NOTHING
    (finding,) = found.record_findings
    assert finding.name == "closed-loop"
    assert "act at once are left out" in finding.description
    assert "setpoint as the input" in finding.advice
