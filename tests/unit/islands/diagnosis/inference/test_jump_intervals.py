"""Intervals of values that jump: they contain the true ones, and all that give the same response."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
)
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.jump_intervals import find_jump_intervals
from islands.effects.hysteresis import STICTION, stick
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.effects.quantiser import QUANTISED_INPUT
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.output_equation import add_output_equation
from islands.simulators.specification.factory import make_simulator

#: Standard deviation of the noise.
NOISE = 0.01


def make_levels(seed: int) -> Signal:
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-2.0, 2.0, 100), rng.integers(15, 45, 100))[:1200]


def fit(
    u: Signal, moved: Signal, effect: Effect, values: tuple[float, ...]
) -> tuple[CalibrationResult, Target]:
    """Fit a plant of second order behind an actuator with these values."""
    noise = NOISE * np.random.default_rng(8).standard_normal(u.size)
    record = Dataset(u, lfilter([0.0, 0.03], [1.0, -1.75, 0.77], moved) + noise, 0.1)
    fitted = count_fitted_samples(record)
    simulator = make_simulator("linear:2", record)
    context = make_context(record, simulator, fitted)
    simulation = ExtendedSimulator(add_output_equation(simulator, context), (effect,), context)
    start, target = simulation.nominal, make_target(record, fitted, {})
    start[simulation.get_slice(effect)] = values
    is_fixed = np.zeros(start.size, dtype=np.bool_)
    is_fixed[simulation.get_slice(effect)] = True
    return calibrate(simulation, target, start, is_fixed=is_fixed), target


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(4))
def test_interval_of_a_breakaway_distance_contains_all_with_the_same_response(seed: int) -> None:
    u = make_levels(seed)
    moved = stick(u, 0.6)
    found, target = fit(u, moved, STICTION, (0.6,))
    intervals = find_jump_intervals(found, STICTION, target)
    assert intervals is not None
    alike = [each for each in np.linspace(0.3, 1.2, 900).tolist() if np.array_equal(stick(u, each), moved)]
    # The values that are compared are denser than this near that of the fit only.
    assert intervals[0][0] < min(alike) + 0.02
    assert max(alike) - 0.02 < intervals[0][1] < 1.0


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(3))
def test_intervals_of_steps_contain_the_true_step_and_offset(seed: int) -> None:
    u = make_levels(seed)
    found, target = fit(u, 0.5 * np.round((u - 0.1) / 0.5) + 0.1, QUANTISED_INPUT, (0.5, 0.1))
    intervals = find_jump_intervals(found, QUANTISED_INPUT, target)
    assert intervals is not None
    (least, most), (first, last) = intervals
    assert least < 0.5 < most < 1.3 * least
    assert first < 0.1 < last < first + 0.25


def test_plant_that_does_not_respond_has_no_interval() -> None:
    u = make_levels(0)
    found, target = fit(u, np.zeros_like(u), STICTION, (0.6,))
    still = found.values.copy()
    still[found.simulation.simulator_slice] = 0.0
    assert find_jump_intervals(evaluate_fit(found.simulation, target, still), STICTION, target) is None
