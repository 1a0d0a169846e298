"""Maps of the input: static ones, play, stick-slip and a rate limit act on the values between samples too."""

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect, Site
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context, map_input
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from support.built_in_simulators import make_oscillator
from support.simulated_records import DT, recorded, wave

Array = NDArray[np.float64]

BETWEEN = sorted(name for name, effect in CATALOGUE.items() if effect.acts_between_samples)
STATIC = [name for name in BETWEEN if name not in ("backlash", "stiction", "rate-limit")]

OSCILLATOR = make_oscillator(0.5, 4.0, 200.0)

#: Samples of a finer record for each sample.
TIMES = 32


def record_of(u: Array, dt: float = DT) -> Dataset:
    return recorded(u, u, dt)


def simulate(
    simulator: Simulator, record: Dataset, effects: tuple[Effect, ...], values: Array | None = None
) -> Array:
    context = make_context(record, simulator, record.samples)
    simulation = ExtendedSimulator(simulator, effects, context)
    return simulation.simulate(set_values(simulation) if values is None else values)


def set_values(simulation: ExtendedSimulator) -> Array:
    """Return values with every effect at a strong starting point."""
    values = simulation.nominal
    for effect in simulation.effects:
        points = effect.starting_points(simulation.context, np.zeros_like(simulation.context.u))
        values[simulation.get_slice(effect)] = points[len(points) // 2]
    return values


@pytest.mark.parametrize("name", STATIC)
def test_a_static_map_acts_on_each_value_alone(name: str) -> None:
    """It is the same for values in any order."""
    effect, record = CATALOGUE[name], record_of(wave())
    assert effect.site == Site.INPUT
    context = make_context(record, OSCILLATOR, record.samples)
    values = np.array(effect.starting_points(context, context.u)[1])
    order = np.random.default_rng(4).permutation(record.samples)
    _, mapped = map_input([(effect, values)], context, is_continuous_time=True)
    assert mapped is not None
    intervals = np.zeros(record.samples)
    assert np.array_equal(mapped(context.u[order], intervals), mapped(context.u, intervals)[order])


@pytest.mark.parametrize("name", BETWEEN)
def test_a_map_of_a_linear_input_is_that_of_a_denser_record(name: str) -> None:
    u = wave(400)
    times = np.arange(TIMES * (u.size - 1) + 1) / TIMES
    dense = record_of(np.interp(times, np.arange(u.size), u), DT / TIMES)
    effects = (CATALOGUE[name],)
    context = make_context(record_of(u), OSCILLATOR, u.size)
    simulation = ExtendedSimulator(OSCILLATOR, effects, context)
    values = set_values(simulation)
    exact = simulate(OSCILLATOR, dense, effects, values)[::TIMES]
    found = simulate(ResampledSimulator(OSCILLATOR, oversampling=8), record_of(u), effects, values)
    own = values[simulation.get_slice(effects[0])]
    sampled, _ = map_input([(effects[0], own)], context, is_continuous_time=False)
    of_samples = simulate(ResampledSimulator(OSCILLATOR, oversampling=8), record_of(sampled), ())
    error, coarse = (float(np.sqrt(np.mean((each - exact) ** 2))) for each in (found, of_samples))
    assert error < 0.1 * coarse


@pytest.mark.parametrize("name", ["backlash", "rate-limit"])
def test_a_map_follows_a_band_limited_input_between_samples(name: str) -> None:
    """The input has four samples for each period: at the samples alone, it turns too early."""
    times = np.arange(TIMES * 400) / TIMES
    u = sum(np.sin(2 * np.pi * f * times + 9.0 * f) for f in (0.05, 0.11, 0.17, 0.23))
    effects = (CATALOGUE[name],)
    dense, sampled = record_of(np.asarray(u), DT / TIMES), record_of(np.asarray(u)[::TIMES])
    simulator = ResampledSimulator(OSCILLATOR, InterSample.BAND_LIMITED, 8)
    context = make_context(sampled, simulator, sampled.samples)
    simulation = ExtendedSimulator(simulator, effects, context)
    values = set_values(simulation)
    part = simulation.get_slice(effects[0])
    exact = ExtendedSimulator(OSCILLATOR, effects, make_context(dense, OSCILLATOR, dense.samples))
    moved, _ = map_input([(effects[0], values[part])], context, is_continuous_time=False)
    expected = exact.simulate(values)[::TIMES]
    found = simulation.simulate(values)
    of_samples = simulate(simulator, record_of(moved), ())
    inner = slice(20, -20)  # the interpolation reads ten samples on each side
    error, coarse = (float(np.sqrt(np.mean((each - expected)[inner] ** 2))) for each in (found, of_samples))
    assert error < 0.1 * coarse


@pytest.mark.parametrize("name", [name for name in BETWEEN if name != "rate-limit"])
def test_a_map_of_a_held_input_is_that_of_its_samples(name: str) -> None:
    record = record_of(np.repeat(wave(150), 4))
    held = ResampledSimulator(OSCILLATOR, InterSample.ZOH, 4)
    simulation = ExtendedSimulator(held, (CATALOGUE[name],), make_context(record, held, record.samples))
    values = set_values(simulation)[simulation.get_slice(CATALOGUE[name])]
    sampled, _ = map_input([(CATALOGUE[name], values)], simulation.context, is_continuous_time=False)
    expected = simulate(held, record_of(sampled), ())
    assert simulation.simulate(set_values(simulation)) == pytest.approx(
        expected, abs=1e-12 * np.ptp(expected)
    )
