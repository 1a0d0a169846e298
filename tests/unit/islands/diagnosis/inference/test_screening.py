"""Screening: effects are judged by what the parameters of a simulation cannot reproduce, in either order."""

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate, evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.progress import ignore_progress
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.linear import LinearSimulator
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded, wave

SAMPLES = 200_000


@pytest.mark.ci
def test_parameter_whose_change_lets_the_simulation_diverge_absorbs_nothing() -> None:
    """An integrator is finite over a record, and a pole slightly above one is not."""
    u = np.random.default_rng(0).standard_normal(SAMPLES)
    y = np.cumsum(u)
    simulator = LinearSimulator(np.array([1.0, 0.0]), np.array([1.0]), 0.0, 0.0, 0, "um")
    record = Dataset(u[:, None], y, 0.01)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, SAMPLES))
    target = Target(y + 1.0, np.ones(SAMPLES, dtype=bool), None, {}, fitted=SAMPLES)
    fit = evaluate_fit(simulation, target, simulation.nominal)
    shifted = fit.values + 0.01 * np.diag(simulation.scales)
    diverges = [bool(np.isnan(each).any()) for each in simulation.simulate_batch(shifted)]
    assert diverges == [False, False, True, False, False]
    projection = Projection(fit, target)
    # The level absorbs a constant. A ramp is what the parameter would have absorbed approximately.
    constant, ramp = (projection(each) for each in (np.ones(SAMPLES), np.linspace(0.0, 1.0, SAMPLES)))
    assert float(np.linalg.norm(constant)) < 1e-6 * float(np.linalg.norm(ramp))
    assert projection.absorb(np.ones(SAMPLES))[2] == 0.0


@pytest.mark.parametrize("names", [("dead-zone", "backlash"), ("backlash", "dead-zone")])
def test_a_map_of_an_actuator_is_added_before_or_behind_another_one(names: tuple[str, str]) -> None:
    samples, simulator = 600, make_oscillator(0.5, 4.0, 200.0)
    record = recorded(wave(samples), wave(samples))
    context = make_context(record, simulator, samples)
    true = ExtendedSimulator(simulator, tuple(CATALOGUE[name] for name in names), context)
    values = true.nominal
    for effect in true.effects:
        values[true.get_slice(effect)] = 0.05 * context.input_peak
    y = true.simulate(values)
    y += 0.01 * y.std() * np.random.default_rng(4).standard_normal(samples)
    target = Target(y, np.ones(samples, dtype=bool), None, {}, fitted=samples)
    alone = true.with_effects((CATALOGUE["backlash"],))
    start = alone.nominal
    start[-1] = 0.05 * context.input_peak
    base = calibrate(alone, target, start)
    effects = (CATALOGUE["dead-zone"], CATALOGUE["offset"])
    run = DiagnosisRun(effects, np.random.default_rng(0), map, ignore_progress)
    found = screen_effects(base, target, run)
    assert tuple(each.name for each in found[0].fit.simulation.effects) == names
    added = found[0].fit.simulation.with_effects((*found[0].fit.simulation.effects, CATALOGUE["offset"]))
    assert tuple(each.name for each in added.effects) == (*names, "offset")
