"""Effects of time that need another behaviour of the input between samples."""

import numpy as np
import pytest
import scipy

from islands.diagnosis.calibration.intersample_selection import get_discretisation
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis, with_effect
from islands.diagnosis.inference.screening import screen_effects
from islands.diagnosis.inference.strategies import make_outcome
from islands.diagnosis.inference.timing_alternatives import add_timing_alternatives, find_timing_simulator
from islands.diagnosis.run import DiagnosisRun
from islands.effects.baseline import OFFSET
from islands.effects.interface.effect import Effect
from islands.effects.timing import DELAY, RESONANCE, SENSOR_LAG
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded

SAMPLES, DT, FINE = 1500, 0.01, 20

#: Delay in seconds: three tenths of a sample.
LATE = 0.003

SIMULATOR = make_oscillator(0.5, 2.0, 500.0)


def find_in_late_record(effect: Effect) -> tuple[Hypothesis, Hypothesis, Target, DiagnosisRun]:
    """Return a hypothesis with one effect, and the one without, for a band-limited input that acts late."""
    t = DT / FINE * np.arange(SAMPLES * FINE)
    rng = np.random.default_rng(6)
    lines = list(zip(rng.uniform(0.3, 25.0, 40), rng.uniform(0, 2 * np.pi, 40), strict=True))
    u, late = (sum(np.sin(2 * np.pi * f * (t - tau) + p) for f, p in lines) for tau in (0.0, LATE))
    y = scipy.signal.lsim(([1.0], [0.5, 2.0, 500.0]), late, t)[1][::FINE]
    noise = np.random.default_rng(7).standard_normal(SAMPLES)
    record = recorded(np.asarray(u)[::FINE], y + 1e-3 * np.std(y) * noise, DT)
    simulation = ExtendedSimulator(SIMULATOR, (), make_context(record, SIMULATOR, SAMPLES))
    target = Target(record.y, np.ones(SAMPLES, dtype=bool), None, {}, fitted=SAMPLES)
    base = calibrate(simulation, target, simulation.nominal)
    without = Hypothesis(base, base.score, ())
    run = DiagnosisRun((DELAY, SENSOR_LAG, RESONANCE, OFFSET), np.random.default_rng(1))
    (screened,) = screen_effects(base, target, run.with_effects([effect]))
    return with_effect(without, screened), without, target, run


def test_a_resonance_next_to_a_wrong_hold_is_a_delay_next_to_the_right_one() -> None:
    hypothesis, _, target, run = find_in_late_record(RESONANCE)
    simulator = find_timing_simulator(hypothesis, target, run)
    assert simulator is not None
    assert get_discretisation(simulator)[0] == InterSample.BAND_LIMITED


def test_the_alternatives_to_an_effect_of_time_have_another_hold() -> None:
    hypothesis, without, target, run = find_in_late_record(RESONANCE)
    screened = screen_effects(without.fit, target, run)
    outcome = make_outcome(without.fit, screened, target, hypothesis)
    found = add_timing_alternatives(outcome, run).timing_alternatives["resonance"]
    gains = {each.effect.name: each.score_gain(without.fit) for each in screened}
    assert {each.effect for each in found.screened} == {DELAY, SENSOR_LAG}
    best = max(found.screened, key=lambda each: each.score_gain(without.fit))
    assert best.score_gain(without.fit) > gains["resonance"] > gains["delay"]
    assert best.effect is DELAY
    assert best.fit.values[best.fit.simulation.get_slice(DELAY)][0] == pytest.approx(LATE, rel=0.05)
