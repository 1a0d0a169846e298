"""Saturation of a sensor: its limit may exceed the nominal output, and a drift acts before or after it."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.effects.catalogue import CATALOGUE
from islands.simulators.extended import ExtendedSimulator, make_context
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded, wave

NAMES = ("output-saturation", "linear-drift", "offset", "sensor-gain", "cubic-stiffness", "delay")


def simulate(stiffness: float) -> np.ndarray:
    u, oscillator = wave(1500), make_oscillator(0.5, 4.0, stiffness)
    simulation = ExtendedSimulator(oscillator, (), make_context(recorded(u, u), oscillator, u.size))
    return simulation.simulate(simulation.nominal)


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.9, 1.0, 1.1, 30.0])
def test_limits_of_a_sensor_begin_within_the_measured_values(ratio: float) -> None:
    """Whatever the scale of the nominal simulation is."""
    u, oscillator = wave(400), make_oscillator(0.5, 4.0, 200.0)
    context = make_context(recorded(u, u), oscillator, 300)
    context = replace(context, measured=ratio * context.output_peak * np.sin(0.1 * np.arange(u.size)))
    effect = CATALOGUE["output-saturation"]
    (cut,), points = effect.parameters(context), effect.starting_points(context, u)
    assert cut.lower <= cut.nominal == 0.0 < cut.upper
    assert all(cut.lower < point < cut.upper for (point,) in points)
    levels = [context.output_peak * (1.0 - point) for (point,) in points]
    assert max(levels) < np.abs(context.measured).max() or ratio == 0.0
    assert min(levels) > 0.0
    # The hold-out part tests the limit.
    later = np.arange(u.size) * context.dt >= context.fit_end_time
    other = replace(context, measured=np.where(later, 100.0, context.measured))
    assert effect.starting_points(other, u) == points


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, *(each for each in (1, 2))])
@pytest.mark.parametrize("drifts_first", [True, False])
def test_a_limit_above_the_nominal_output_is_found_on_its_side_of_a_drift(
    seed: int, drifts_first: bool
) -> None:
    """The stiffness is 20 % less than the nominal one, so that the output is larger."""
    clean, nominal = simulate(160.0), simulate(200.0)
    noise = 0.003 * clean.std() * np.random.default_rng(seed).standard_normal(clean.size)
    level, drift = 0.9 * np.abs(clean).max(), 0.05 * clean.std() * np.linspace(0.0, 1.0, clean.size)
    assert level > np.abs(nominal).max()
    y = np.clip(clean + drift, -level, level) if drifts_first else np.clip(clean, -level, level) + drift
    record = recorded(wave(1500), y + noise)
    found = islands.diagnose(record, make_oscillator(0.5, 4.0, 200.0), effects=[CATALOGUE[n] for n in NAMES])
    assert sorted(found.claimed_names) == ["linear-drift", "output-saturation"]
    first, second = (each.name for each in found.best.simulation.effects)
    assert (first, second) == (NAMES[1::-1] if drifts_first else NAMES[:2])
    cut = next(each for each in found.effects if each.name == "output-saturation").parameters["cut"].value
    assert (1.0 - cut) * found.best.simulation.context.output_peak == pytest.approx(level, rel=1e-3)
