"""Screening and stepwise search: results, and independence of the order of evaluation."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
)
from islands.diagnosis.calibration.preparation import count_fitted_samples, select_effects
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis, without_effect
from islands.diagnosis.inference.screening import SCORE_TIE, screen_effects
from islands.diagnosis.inference.stepwise_search import MIN_GAIN, refine_by_swaps, stepwise_search
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import PythonFunctionSimulator, RecordedOutput
from islands.simulators.interface import Simulator
from lab.diagnosis.trial import Trial, run_trial
from support.built_in_simulators import make_piezo
from support.simulated_records import DT, made, recorded, wave

Array = NDArray[np.float64]


def backwards(function: Callable, arguments: Iterable) -> Iterator:
    """Evaluate the last argument first, and return the results in the order of the arguments."""
    results = [function(each) for each in reversed(list(arguments))]
    return iter(reversed(results))


#: Effects of several families, for tests that do not depend on the number of effects.
SOME = (
    "delay",
    "offset",
    "jump",
    "thermal-drift",
    "exponential-creep",
    "even-nonlinearity",
    "cubic-stiffness",
)


def select_some(effects: Iterable[Effect]) -> list[Effect]:
    return [effect for effect in effects if effect.name in SOME]


def calibrate_to(
    record: Dataset, core: Simulator, effective: float | None = None
) -> tuple[CalibrationResult, Target]:
    samples = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, samples))
    target = Target(record.y, np.arange(record.samples) < samples, None, {}, effective, fitted=samples)
    return calibrate(simulation, target, simulation.nominal), target


@pytest.mark.ci
def test_screening_does_not_depend_on_the_order_of_evaluation() -> None:
    u = wave(300)
    core = make_piezo()
    nominal, _ = calibrate_to(recorded(u, u), core)
    y = nominal.output + 1e-4 * u**2 + 0.05 * np.random.default_rng(2).standard_normal(u.size)
    base, target = calibrate_to(recorded(u, y), core)
    effects = select_some(select_effects(core, base.simulation.context, {}))
    runs = [DiagnosisRun(effects, parallel_map=parallel_map) for parallel_map in (map, backwards)]
    forward, backward = (screen_effects(base, target, run) for run in runs)
    assert [each.effect.name for each in forward] == [each.effect.name for each in backward]
    for one, other in zip(forward, backward, strict=True):
        assert np.array_equal(one.fit.values, other.fit.values)
        assert one.score_gain(base) == other.score_gain(base)
    gains = [each.score_gain(base) for each in forward]
    assert all(after < before + SCORE_TIE for before, after in pairwise(gains))
    assert forward[0].effect.name == "even-nonlinearity"
    selected = [stepwise_search(base, forward, target, run)[0].effects for run in runs]
    assert [[each.name for each in found] for found in selected] == [["even-nonlinearity"]] * 2


@pytest.fixture
def masked() -> tuple[CalibrationResult, Target, DiagnosisRun]:
    """An offset and a drift that mask each other.

    The offset alone explains nothing, since the sum of both is orthogonal to it. The drift alone explains a
    quarter, which is not enough. Both together are found.
    """
    u = wave()
    samples = 3 * u.size // 4
    time = DT * np.arange(u.size)
    both = np.column_stack([np.ones(u.size), time])[:samples]
    # a + b t with zero mean: its projection on the offset is zero.
    sum_ = time - time[:samples].mean()
    noise = np.random.default_rng(7).standard_normal(u.size)
    noise[:samples] -= both @ np.linalg.lstsq(both, noise[:samples], rcond=None)[0]
    gain = 3.5 * np.log(samples)
    power = float(np.sum(sum_[:samples] ** 2))
    size = np.sqrt(np.expm1(gain / samples) * float(noise[:samples] @ noise[:samples]) / power)
    record = recorded(u, u + noise + size * sum_)
    base, target = calibrate_to(record, RecordedOutput("theirs", u))
    return base, target, DiagnosisRun([CATALOGUE["offset"], CATALOGUE["linear-drift"]])


def test_effects_that_mask_each_other_are_only_found_as_a_pair(masked) -> None:
    base, target, run = masked
    screened = screen_effects(base, target, run)
    assert all(each.score_gain(base) < MIN_GAIN for each in screened)
    assert stepwise_search(base, screened, target, run)[0].effects == ()
    found, _ = stepwise_search(base, screened, target, run, pairs=True)
    assert {each.name for each in found.effects} == {"offset", "linear-drift"}
    assert found.cost < base.score - MIN_GAIN


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, *(seed for seed in (1, 2, 3))])
def test_equivalent_effects_keep_the_catalogue_order(seed: int) -> None:
    """Rounding does not decide: a sensor offset and a constant force are not distinguishable."""
    oscillator = made()["second-order"]
    record, core = oscillator.record, oscillator.simulator
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(record.samples)
    base, target = calibrate_to(replace(record, y=record.y + 0.01 + noise), core)
    effects = select_effects(core, base.simulation.context, {})
    one, other = screen_effects(base, target, DiagnosisRun(effects))[:2]
    assert (one.effect.cause, other.effect.cause) == ("offset", "input-offset")
    assert one.score_gain(base) == pytest.approx(other.score_gain(base), abs=SCORE_TIE)
    found, _ = stepwise_search(base, (one, other), target, DiagnosisRun(effects))
    assert [each.name for each in found.effects] == ["offset"]


def test_divergence_without_an_effect_restarts_at_nominal_values() -> None:
    """A value that diverges without the effect is not a starting point for the remaining simulation."""
    u = wave(3000)

    def diverging(u: Array, _dt: float, gain: float = 1.0) -> Array:
        return gain * u if gain * np.ptp(u) < 1.5 * np.ptp(wave(3000)) else np.full(u.size, np.nan)

    core = PythonFunctionSimulator(diverging, "theirs.py:diverging")
    base, target = calibrate_to(
        recorded(u, u + 0.01 * np.random.default_rng(5).standard_normal(u.size)), core
    )
    effect = CATALOGUE["input-gain"]
    simulation = base.simulation.with_effects((effect,))
    found = Hypothesis(evaluate_fit(simulation, target, np.array([2.0, -0.5])), 0.0, (effect,))
    without = without_effect(found, effect, target)
    assert without.fit.values == pytest.approx([1.0], rel=1e-2)
    assert np.isfinite(without.cost)


def test_effect_that_the_refitted_simulation_does_not_need_is_removed() -> None:
    """The earlier fit was in another minimum, or whitened by a preliminary noise model."""
    u = wave(3000)

    def scaled(u: Array, _dt: float, gain: float = 1.0) -> Array:
        return gain * u

    noise = 0.01 * np.random.default_rng(5).standard_normal(u.size)
    base, target = calibrate_to(
        recorded(u, 1.3 * u + noise), PythonFunctionSimulator(scaled, "theirs.py:scaled")
    )
    effects = [CATALOGUE["input-gain"], CATALOGUE["jump"]]
    fit = evaluate_fit(base.simulation.with_effects(effects[:1]), target, np.array([1.0, 0.3]))
    initial = Hypothesis(fit, fit.score, tuple(effects[:1]))
    found, _ = refine_by_swaps(initial, target, DiagnosisRun(effects))
    assert found.effects == ()
    assert found.fit.values == pytest.approx([1.3], rel=1e-3)


#: Causes, seed and core of trials, each with another difficulty.
TRIALS = {
    # The gain step looks like a thermal drift, and the offset gains nothing next to that.
    "two-at-once": (("offset", "delay", "gain-step"), 7700005, "cascaded-tanks"),
    # Without the offset, the limit of the level is in another minimum.
    "two-minima": (("offset", "state-clip"), 7700000, "cascaded-tanks"),
    # Two effects imitate the flow better than any one, until that takes the place of both.
    "one-for-two": (("jump", "input-offset"), 6970000, "cascaded-tanks"),
    # A delay that swings imitates both, and explains more than either of them.
    "two-for-one": (("delay", "clock-skew"), 6998003, "bouc-wen-piezo"),
    # The flow and the offset oppose each other, and only both together leave white noise.
    "opposed": (("outflow-law", "cross-coupling", "offset"), 6998005, "cascaded-tanks"),
    # They oppose each other, and the noise model takes what is left of both for noise.
    "opposed-alone": (("jump", "linear-drift"), 6999209, "cascaded-tanks"),
    # The linear response to a gain step of unknown time explains a sixth of its gain next to a drift.
    "opposed-at-a-time": (("input-saturation", "gain-step", "thermal-drift"), 6999601, "cascaded-tanks"),
    "opposed-at-a-time-flow": (("outflow-law", "gain-step", "input-saturation"), 6999603, "cascaded-tanks"),
    # A drift and an offset imitate the two others, and neither of these takes the place of one of them.
    "two-for-two": (("output-saturation", "state-clip", "ageing"), 6999610, "cascaded-tanks"),
    # The cyclic error is calibrated together with two wrong effects.
    "two-for-two-cyclic": (("thermal-drift", "input-offset", "cyclic-error"), 6999611, "cascaded-tanks"),
    # The gain acts in front of the dead zone; behind it, the rest was a discovered term.
    "gain-before-dead-zone": (("temperature-gain", "dead-zone"), 6999303, "second-order"),
    # By ordinary least squares, a jump is added in place of the step of the gain.
    "unweighted-swap": (("state-clip", "gain-step", "linear-drift"), 6999015, "cascaded-tanks"),
    # A lag gains as much as the drift next to the ageing gain, and explains less.
    "unweighted-drift": (("linear-drift", "delay", "ageing"), 6999306, "cascaded-tanks"),
    # The noise model takes two of them for noise, and the first one explains half of the misfit.
    "unweighted": (("viscous", "jump", "exponential-creep"), 6998005, "bouc-wen-piezo"),
}


@pytest.mark.nightly
@pytest.mark.parametrize("name", TRIALS)
def test_several_causes_are_found_though_one_alone_is_another(name: str) -> None:
    effects, seed, core = TRIALS[name]
    found = run_trial(Trial(effects, seed, band=(1.0, 4.0), core=core))
    assert found.within_sets
    assert found.noise == ()
