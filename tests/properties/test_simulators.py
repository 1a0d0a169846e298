"""Properties of every simulator: its declarations are correct, and effects at rest have no response."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.preparation import count_fitted_samples, select_effects
from islands.effects.catalogue import catalogue_order
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Effect
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from support.simulated_records import made, names

pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("toy_class")]


def make(name: str) -> Simulator:
    found = made()[name].simulator
    return found.simulator if name in {"held", "terms"} else found


@pytest.fixture(params=names())
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def simulator(name: str) -> Simulator:
    return make(name)


@pytest.fixture
def context(name: str, simulator: Simulator) -> SimulationContext:
    record = made()[name].record
    return make_context(record, simulator, count_fitted_samples(record))


@pytest.fixture
def alone(simulator: Simulator, context: SimulationContext) -> ExtendedSimulator:
    return ExtendedSimulator(simulator, (), context)


def possible_effects(simulator: Simulator, context: SimulationContext) -> list[Effect]:
    """Return all effects that can enter, including gains and wrong parameters, which require tolerances."""
    free = select_effects(simulator, context, {})
    tolerance = {each.name: 0.1 for each in simulator.parameters if not each.initial}
    return list(
        {each.name: each for each in (*free, *select_effects(simulator, context, tolerance))}.values()
    )


def test_a_simulation_has_a_finite_value_for_every_sample(
    alone: ExtendedSimulator, context: SimulationContext
) -> None:
    simulated = alone.simulate(alone.nominal)
    assert simulated.shape == context.u.shape
    assert simulated.dtype == np.float64
    assert np.isfinite(simulated).all()


def test_the_same_input_gives_the_same_bits(
    name: str, alone: ExtendedSimulator, simulator: Simulator, context: SimulationContext
) -> None:
    u = context.u.copy()
    first = alone.simulate(alone.nominal)
    again = ExtendedSimulator(simulator, (), context)
    assert np.array_equal(again.simulate(again.nominal), first)
    other = ExtendedSimulator(simulator if name in {"held", "terms"} else made()[name].simulator, (), context)
    assert np.array_equal(other.simulate(other.nominal), first)
    assert np.array_equal(context.u, u)


def test_every_parameter_changes_the_output(alone: ExtendedSimulator) -> None:
    at_rest = alone.simulate(alone.nominal)
    for place, parameter in enumerate(alone.parameters):
        values = alone.nominal
        values[place] += alone.scales[place]
        changed = alone.simulate(np.minimum(values, alone.bounds[1])) - at_rest
        assert np.isfinite(changed).all(), parameter
        assert np.max(np.abs(changed)) > 0.0, parameter


def test_the_force_coordinate_has_units_and_positive_scales(context: SimulationContext) -> None:
    coordinate = context.force_coordinate
    assert min(coordinate.peak, coordinate.rate, coordinate.force, coordinate.friction_smoothing) > 0.0
    assert coordinate.unit
    assert coordinate.force_unit
    assert coordinate.sign in (-1.0, 1.0)
    assert coordinate.lower_bound == (0.0 if coordinate.is_dissipative else -np.inf)


def test_an_effect_at_rest_does_not_change_the_output(
    simulator: Simulator, alone: ExtendedSimulator, context: SimulationContext
) -> None:
    at_rest = alone.simulate(alone.nominal)
    found = possible_effects(simulator, context)
    assert found
    for effect in found:
        extended = alone.with_effects([effect])
        assert np.array_equal(extended.simulate(extended.nominal), at_rest), effect.name


def test_every_possible_effect_changes_the_output_at_a_starting_point(
    simulator: Simulator, alone: ExtendedSimulator, context: SimulationContext
) -> None:
    """Starting points are within bounds; the response to one of them at least is finite and not zero."""
    at_rest = alone.simulate(alone.nominal)
    residual = 0.01 * context.output_peak * np.sin(2 * np.pi * 7.3 * context.time)
    for effect in possible_effects(simulator, context):
        extended = alone.with_effects([effect])
        lower, upper = extended.bounds
        changes = []
        for point in effect.starting_points(context, residual):
            values = extended.nominal
            values[extended.get_slice(effect)] = point
            assert (lower <= values).all(), effect.name
            assert (values <= upper).all(), effect.name
            changes.append(np.max(np.abs(extended.simulate(values) - at_rest)))
        assert np.isfinite(changes).any(), effect.name
        assert np.nanmax(changes) > 0.0, effect.name


def test_several_vectors_of_values_have_the_bits_of_one_by_one(
    simulator: Simulator, alone: ExtendedSimulator, context: SimulationContext
) -> None:
    """With an effect on the input, in the equation and on the output, where these are possible."""
    by_site = {each.site: each for each in possible_effects(simulator, context)}
    extended = alone.with_effects(catalogue_order(by_site.values()))
    points = np.tile(extended.nominal, (11, 1))
    lower, upper = extended.bounds
    for row, place in enumerate(np.linspace(0, extended.nominal.size - 1, 10).astype(int)):
        points[row, place] = np.clip(points[row, place] + extended.scales[place], lower[place], upper[place])
    fresh = replace(extended)
    one_by_one = np.stack([fresh.simulate(point) for point in points])
    assert np.array_equal(extended.simulate_batch(points), one_by_one)
    assert np.array_equal(extended.simulate_batch(points[::-1]), one_by_one[::-1])
    assert len(np.unique(one_by_one, axis=0)) > 1
