"""Instants, steps and breakaway distances are found where a calibration does not move them."""

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.pattern_search import Coordinate, search_pattern
from islands.diagnosis.calibration.target import Target
from islands.effects.baseline import JUMP
from islands.effects.time_variation import GAIN_STEP, instant_bounds
from islands.simulators.extended import ExtendedSimulator, make_context
from support.built_in_simulators import make_oscillator
from support.simulated_records import DT, recorded, wave

SAMPLES = 600

#: True instant, and the one at which the calibration ends, in seconds.
TRUE, WRONG = 271.3 * DT, 120.0 * DT


@pytest.mark.parametrize("effect", [JUMP, GAIN_STEP])
def test_an_instant_moves_to_the_true_one_over_many_samples(effect) -> None:
    record = recorded(wave(SAMPLES), wave(SAMPLES))
    simulator = make_oscillator(0.5, 4.0, 200.0)
    context = make_context(record, simulator, SAMPLES)
    simulation = ExtendedSimulator(simulator, (effect,), context)
    part = simulation.get_slice(effect)
    values = simulation.nominal
    values[part] = 0.1 * (context.output_peak if effect is JUMP else 1.0), TRUE
    y = simulation.simulate(values)
    y += 0.01 * y.std() * np.random.default_rng(3).standard_normal(SAMPLES)
    target = Target(y, np.ones(SAMPLES, dtype=bool), None, {}, fitted=SAMPLES)
    start = values.copy()
    start[part.start + 1] = WRONG
    calibrated = calibrate(simulation, target, start)
    assert abs(calibrated.values[part.start + 1] - TRUE) > 5 * DT
    instant = Coordinate(part.start + 1, *instant_bounds(context), largest=80 * DT, smallest=2 * DT)
    moved = search_pattern(calibrated, target, [instant])
    assert moved.values[part.start + 1] == pytest.approx(TRUE, abs=2 * DT)
    assert moved.score < calibrated.score
