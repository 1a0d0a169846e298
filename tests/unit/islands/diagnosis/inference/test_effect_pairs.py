"""Pairs of effects that explain a residual together."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.effect_pairs import EffectPair, add_pair, rank_pairs
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator
from support.simulated_records import DT, recorded, wave

EFFECTS = [CATALOGUE[name] for name in ("offset", "linear-drift", "jump", "delay", "even-nonlinearity")]

SAMPLES, NOISE, DRIFT, JUMP = 400, 0.05, 0.4, -0.25


def repeat(u: np.ndarray, _dt: float, gain: float = 1.0) -> np.ndarray:
    return gain * u


@pytest.fixture(scope="module")
def opposed() -> tuple[CalibrationResult, Target]:
    """Fit of an input that is measured with a drift, and with a jump that undoes most of it."""
    u, t = wave(SAMPLES), np.arange(SAMPLES) / SAMPLES
    y = u + DRIFT * t + JUMP * (t >= 0.5) + NOISE * np.random.default_rng(4).standard_normal(SAMPLES)
    record, core = recorded(u, y), PythonFunctionSimulator(repeat, "theirs.py:repeat")
    simulation = ExtendedSimulator(core, (), make_context(record, core, SAMPLES))
    target = Target(record.y, np.ones(SAMPLES, dtype=bool), None, {}, None, fitted=SAMPLES)
    return calibrate(simulation, target, simulation.nominal), target


def get_names(pair: EffectPair) -> tuple[str, str]:
    return pair.first.name, pair.second.name


def test_effects_with_the_same_response_are_no_pair(opposed: tuple[CalibrationResult, Target]) -> None:
    base, target = opposed
    twin = replace(CATALOGUE["linear-drift"], name="twin")
    assert rank_pairs(base, target, [CATALOGUE["linear-drift"], twin], 100, 100) == []


def test_pairs_share_an_effect_as_often_as_the_caller_allows(
    opposed: tuple[CalibrationResult, Target],
) -> None:
    base, target = opposed
    every = rank_pairs(base, target, EFFECTS, 100, 100)
    for most in (1, 2):
        names = [get_names(each) for each in rank_pairs(base, target, EFFECTS, 100, most)]
        assert names[0] == get_names(every[0])
        assert max(Counter(name for pair in names for name in pair).values()) == most


def test_strengths_of_a_pair_are_calibrated_together(opposed: tuple[CalibrationResult, Target]) -> None:
    base, target = opposed
    (pair,) = rank_pairs(base, target, EFFECTS, 1, 1)
    found = add_pair(Hypothesis(base, base.score, ()), pair, target, DiagnosisRun(EFFECTS))
    assert found is not None
    assert found.effects == (pair.first, pair.second)
    simulation, values = found.fit.simulation, found.fit.values
    (drift,) = values[simulation.get_slice(CATALOGUE["linear-drift"])]
    jump, instant = values[simulation.get_slice(CATALOGUE["jump"])]
    assert drift == pytest.approx(DRIFT, abs=6.0 * NOISE / SAMPLES**0.5)
    assert jump == pytest.approx(JUMP, abs=6.0 * NOISE / SAMPLES**0.5)
    assert instant == pytest.approx(0.5 * SAMPLES * DT, abs=2.0 * DT)
    assert found.fit.mean_square == pytest.approx(NOISE**2, rel=0.2)
    assert found.cost < base.score
