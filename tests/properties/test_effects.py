"""Properties of every effect in the catalogue: no response at rest, and correct declarations."""

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Site
from islands.simulators.extended import ExtendedSimulator
from support.built_in_simulators import make_piezo


@pytest.fixture(scope="module")
def context() -> SimulationContext:
    rng = np.random.default_rng(3)
    time = np.arange(1500) * 0.01
    u = 40 * np.sin(2 * np.pi * 0.7 * time) * np.sin(2 * np.pi * 0.11 * time)
    channels = {"T_K": np.cumsum(rng.normal(size=time.size)), "w_V": rng.normal(size=time.size)}
    units = {"T_K": "K", "w_V": "V"}
    return SimulationContext(u, 0.01, channels, units, 40.0, 33.0, "V", "um", 11.0, measured=0.8 * u)


@pytest.fixture(scope="module")
def alone(context: SimulationContext) -> ExtendedSimulator:
    return ExtendedSimulator(make_piezo(), (), context)


@pytest.fixture(params=CATALOGUE)
def extended(request: pytest.FixtureRequest, alone: ExtendedSimulator) -> ExtendedSimulator:
    return alone.with_effects([CATALOGUE[request.param]])


def make_values(extended: ExtendedSimulator, point: tuple[float, ...]) -> np.ndarray:
    values = extended.nominal
    values[extended.get_slice(extended.effects[0])] = point
    return values


def starting_points(extended: ExtendedSimulator) -> tuple[tuple[float, ...], ...]:
    residual = 0.1 * np.sin(2 * np.pi * 7.3 * extended.context.time)
    return tuple(extended.effects[0].starting_points(extended.context, residual))


def test_an_effect_at_rest_does_not_change_the_output(
    extended: ExtendedSimulator, alone: ExtendedSimulator
) -> None:
    assert np.array_equal(extended.simulate(extended.nominal), alone.simulate(alone.nominal))


def test_every_starting_point_is_within_bounds_and_has_a_response(
    extended: ExtendedSimulator, alone: ExtendedSimulator
) -> None:
    lower, upper = extended.bounds
    points = starting_points(extended)
    assert points
    at_rest = alone.simulate(alone.nominal)
    for point in points:
        values = make_values(extended, point)
        assert (values >= lower).all()
        assert (values <= upper).all()
        simulated = extended.simulate(values)
        assert np.isfinite(simulated).all()
        assert np.max(np.abs(simulated - at_rest)) > 1e-4


def test_the_response_is_proportional_to_the_linear_parameters(
    extended: ExtendedSimulator, alone: ExtendedSimulator
) -> None:
    """Half the strength has half the response; approximately if the effect acts before the simulator."""
    effect = extended.effects[0]
    if effect.linear_parameters == 0:
        pytest.skip("the effect has a threshold")
    at_rest = alone.simulate(alone.nominal)
    point = np.array(starting_points(extended)[0])
    part = slice(0, effect.linear_parameters)
    exact = effect.site in (Site.FORCE, Site.OUTPUT) and effect.family != "timing"
    size = 1.0 if exact else 1e-3
    responses = []
    for strength in (size, size / 2):
        scaled = point.copy()
        scaled[part] *= strength
        responses.append(extended.simulate(make_values(extended, tuple(scaled))) - at_rest)
    error = float(np.std(responses[1] - responses[0] / 2))
    assert error <= (1e-9 if exact else 0.1) * float(np.std(responses[0]) + abs(np.mean(responses[0])))


def test_a_hundredth_of_a_scale_is_a_suitable_step_of_a_derivative(extended: ExtendedSimulator) -> None:
    """Steps of a hundredth and of a fiftieth of a parameter's scale agree within a fifth."""
    if extended.effects[0].centre is not None:
        pytest.skip("the response is discontinuous")
    points = starting_points(extended)
    base = make_values(extended, points[len(points) // 2])
    _, upper = extended.bounds
    reference = extended.simulate(base)
    for place in range(extended.get_slice(extended.effects[0]).start, base.size):
        slopes = []
        for part in (0.01, 0.02):
            step = (
                part
                * extended.scales[place]
                * (1 if base[place] + 0.02 * extended.scales[place] <= upper[place] else -1)
            )
            moved = base.copy()
            moved[place] += step
            slopes.append((extended.simulate(moved) - reference) / step)
        size = np.linalg.norm(slopes[0])
        assert size > 0.0
        assert np.linalg.norm(slopes[1] - slopes[0]) < 0.2 * size


def test_the_declarations_of_an_effect_are_complete_and_consistent(extended: ExtendedSimulator) -> None:
    effect = extended.effects[0]
    parameters = effect.parameters(extended.context)
    assert parameters
    assert effect.source
    assert effect.family
    for parameter in parameters:
        assert parameter.scale > 0.0
        assert parameter.lower < parameter.upper
    assert (effect.form is None) == (effect.site == Site.CORE)
    assert effect.site != Site.CORE or effect.name in extended.simulator.supported_effects


def test_the_cache_of_a_simulation_does_not_change_its_output(alone: ExtendedSimulator) -> None:
    values = alone.nominal
    first = alone.simulate(values).copy()
    for factor in (1.1, 0.9, 1.2, 0.8, 1.3, 1.0):
        moved = values * factor
        fresh = ExtendedSimulator(alone.simulator, alone.effects, alone.context).simulate(moved)
        assert np.array_equal(alone.simulate(moved), fresh)
    assert np.array_equal(alone.simulate(values), first)
