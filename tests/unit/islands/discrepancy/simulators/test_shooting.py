"""Multiple shooting: fitted states, and derivatives of outputs with fitted states."""

import numpy as np
import pytest

from islands.discrepancy.calibration.preparation import make_context
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.simulators.extended import ExtendedSimulator
from support.simulated_records import made

EFFECTS = {
    "without effects": [],
    "a force": ["cubic-stiffness"],
    "a state that is kept": ["second-hysteresis"],
}


@pytest.fixture(params=EFFECTS)
def axis(request: pytest.FixtureRequest) -> tuple[ExtendedSimulator, np.ndarray]:
    """Return an axis with effects, and values at which the effects do not vanish."""
    case = made()["rigid-axis"]
    effects = [CATALOGUE[name] for name in EFFECTS[request.param]]
    simulation = ExtendedSimulator(
        case.simulator, effects, make_context(case.record, case.simulator, case.record.samples)
    )
    values = simulation.nominal
    for effect in effects:
        starts = effect.starting_points(simulation.context, case.record.y)
        values[simulation.get_slice(effect)] = starts[-1]
    return simulation, values


def test_change_of_fitted_states_is_their_first_order(axis: tuple[ExtendedSimulator, np.ndarray]) -> None:
    """The output near another one is that of fitted states, without another fit."""
    simulation, values = axis
    points = np.vstack([values + 1e-2 * np.diag(simulation.scales), values])
    near = np.full(len(points), len(points) - 1)
    *found, base = simulation.simulate_batch(points, near)
    assert np.array_equal(base, simulation.simulate_batch(values[None])[0])
    for parameter, point, output in zip(simulation.parameters, points, found, strict=False):
        expected, change = simulation.simulate_batch(point[None])[0] - base, output - base
        assert np.std(change - expected) < 0.05 * np.std(expected) + 1e-11, parameter.name


def test_derivatives_change_no_other_output(
    axis: tuple[ExtendedSimulator, np.ndarray],
) -> None:
    """Neither the order of the calls nor their number changes an output."""
    simulation, values = axis
    points = np.vstack([values + simulation.scales, values])
    alone = simulation.simulate_batch(points)
    first = simulation.simulate_batch(points, np.array([1, 1]))
    assert np.array_equal(first[1], alone[1])
    others = np.vstack([values - simulation.scales, points])
    again = simulation.simulate_batch(others, np.array([0, 2, 2]))
    assert np.array_equal(again[1:], first)
    assert np.array_equal(simulation.simulate_batch(points), alone)
