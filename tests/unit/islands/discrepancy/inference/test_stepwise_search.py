"""The search for causes, and the ladder it climbs: the same in whatever order the work is done."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    Target,
    calibrate,
    evaluate_fit,
)
from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context, select_effects
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.inference.hypothesis import Hypothesis, without_effect
from islands.discrepancy.inference.screening import EQUAL, screen_effects
from islands.discrepancy.inference.stepwise_search import LEAST, refine_by_swaps, stepwise_search
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.python_function import PythonFunctionSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.evolution.progress import ignore_progress
from support.simulated_records import DT, made, recorded, wave

Array = NDArray[np.float64]


def backwards(function: Callable, arguments: Iterable) -> Iterator:
    """Do the last first, and give back what came of it in the order that was asked for."""
    found = [function(each) for each in reversed(list(arguments))]
    return iter(reversed(found))


#: Effects of several families, for searches whose law does not depend on how many there are.
SOME = (
    "delay",
    "offset",
    "jump",
    "thermal-drift",
    "exponential-creep",
    "even-nonlinearity",
    "cubic-stiffness",
)


def some(effects: Iterable[Effect]) -> list[Effect]:
    return [effect for effect in effects if effect.name in SOME]


def calibrated(
    record: Dataset, core: Simulator, effective: float | None = None
) -> tuple[CalibrationResult, Target]:
    samples = count_fitted_samples(record)
    simulation = ExtendedSimulator(core, (), make_context(record, core, samples))
    target = Target(record.y, np.arange(record.samples) < samples, None, {}, effective)
    return calibrate(simulation, target, simulation.nominal), target


@pytest.mark.ci
def test_the_order_of_the_work_changes_no_bit_of_the_ladder() -> None:
    u = wave(300)
    core = BoucWenPiezoSimulator()
    plain, _ = calibrated(recorded(u, u), core)
    y = plain.output + 1e-4 * u**2 + 0.05 * np.random.default_rng(2).standard_normal(u.size)
    base, target = calibrated(recorded(u, y), core)
    effects = some(select_effects(core, base.simulation.context, {}))
    forwards, back = (screen_effects(base, target, effects, spread) for spread in (map, backwards))
    assert [rung.effect.name for rung in forwards] == [rung.effect.name for rung in back]
    for one, other in zip(forwards, back, strict=True):
        assert np.array_equal(one.fit.values, other.fit.values)
        assert one.score_gain(base) == other.score_gain(base)
    gains = [rung.score_gain(base) for rung in forwards]
    assert all(after < before + EQUAL for before, after in pairwise(gains))
    assert forwards[0].effect.name == "even-nonlinearity"
    chosen = [
        tuple(
            each.name
            for each in stepwise_search(base, forwards, target, effects, ignore_progress, spread)[0].effects
        )
        for spread in (map, backwards)
    ]
    assert chosen == [("even-nonlinearity",)] * 2


@pytest.fixture
def hiding() -> tuple[CalibrationResult, Target, list]:
    """An offset and a drift that hide each other.

    The offset alone explains nothing, since the drift has been put at right angles to it in sum; the drift
    alone a quarter, which does not pay; both together do.
    """
    u = wave()
    samples = 3 * u.size // 4
    time = DT * np.arange(u.size)
    both = np.column_stack([np.ones(u.size), time])[:samples]
    # a + b t with no mean: the offset's own part of it is zero.
    sum_ = time - time[:samples].mean()
    noise = np.random.default_rng(7).standard_normal(u.size)
    noise[:samples] -= both @ np.linalg.lstsq(both, noise[:samples], rcond=None)[0]
    gained = 3.5 * np.log(samples)
    power = float(np.sum(sum_[:samples] ** 2))
    size = np.sqrt(np.expm1(gained / samples) * float(noise[:samples] @ noise[:samples]) / power)
    record = recorded(u, u + noise + size * sum_)
    base, target = calibrated(record, RecordedOutput("theirs", u))
    return base, target, [CATALOGUE["offset"], CATALOGUE["linear-drift"]]


def test_two_that_hide_each_other_are_found_as_a_pair_alone(hiding) -> None:
    base, target, effects = hiding
    rungs = screen_effects(base, target, effects)
    assert all(rung.score_gain(base) < LEAST for rung in rungs)
    assert stepwise_search(base, rungs, target, effects, ignore_progress)[0].effects == ()
    found, _ = stepwise_search(base, rungs, target, effects, ignore_progress, pairs=True)
    assert {each.name for each in found.effects} == {"offset", "linear-drift"}
    assert found.cost < base.score - LEAST


def test_without_one_of_its_effects_an_explanation_is_fitted_anew(hiding) -> None:
    base, target, effects = hiding
    found, _ = stepwise_search(
        base, screen_effects(base, target, effects), target, effects, ignore_progress, pairs=True
    )
    for effect in effects:
        left = without_effect(found, effect, target)
        assert effect not in left.effects
        assert len(left.effects) == 1
        assert left.cost > found.cost
        assert left.fit.mean_square > found.fit.mean_square


def test_where_nothing_pays_there_is_no_pair() -> None:
    u = wave()
    noise = np.random.default_rng(9).standard_normal(u.size)
    core = RecordedOutput("theirs", u)
    base, target = calibrated(recorded(u, u + noise), core)
    effects = select_effects(core, base.simulation.context, {})
    found, _ = stepwise_search(
        base, screen_effects(base, target, effects), target, effects, ignore_progress, pairs=True
    )
    assert found.effects == ()
    assert found.fit is base


def test_what_a_second_cause_remembers_is_no_noise_once_it_is_found() -> None:
    """A search that whitens by the first cause's residual ends with noise that does not remember."""
    u = wave(3000)
    time = DT * np.arange(u.size)
    noise = 0.05 * np.random.default_rng(3).standard_normal(u.size)
    core = RecordedOutput("theirs", u)
    base, target = calibrated(recorded(u, u + 0.02 * u**2 + 0.3 * (time > 8.0) + noise), core)
    effects = some(select_effects(core, base.simulation.context, {}))
    rungs = screen_effects(base, target, effects)
    memory = rungs[0].fit.noise
    assert memory.order > 0
    target = replace(target, noise=memory)
    base = calibrate(base.simulation, target, base.values)
    found, target = stepwise_search(
        base, screen_effects(base, target, effects), target, effects, ignore_progress
    )
    assert {each.name for each in found.effects} == {"even-nonlinearity", "jump"}
    assert target.noise is not None
    assert target.noise.order == 0
    best = calibrate(found.fit.simulation, replace(target, noise=None), found.fit.values)
    assert found.fit.score == pytest.approx(best.score, abs=EQUAL)


def test_what_a_tolerance_is_stretched_by_is_left_to_be_explained() -> None:
    """A sensor's gain is taken up by parameters, at a price: beside another cause it is looked at as well."""
    u = wave(3000)
    core = BoucWenPiezoSimulator()
    simulation = ExtendedSimulator(core, (), make_context(recorded(u, u), core, u.size))
    y = 1.1 * simulation.simulate(simulation.nominal) + 2.0
    y = y + 0.05 * np.random.default_rng(4).standard_normal(u.size)
    known = {parameter.name: 0.01 for parameter in core.parameters}
    base, target = calibrated(recorded(u, y), core)
    target = replace(target, prior_std=known)
    effects = select_effects(core, base.simulation.context, known)
    offset = next(each for each in effects if each.name == "offset")
    beside = screen_effects(calibrate(base.simulation, target, base.values), target, [offset])[0].fit
    gains = [rung for rung in screen_effects(beside, target, effects) if rung.effect.is_gain]
    assert gains
    assert gains[0].score_gain(beside) > LEAST


def test_what_explains_more_is_put_in_the_place_of_what_misled() -> None:
    u = wave(3000)
    core = RecordedOutput("theirs", u)
    noise = 0.05 * np.random.default_rng(5).standard_normal(u.size)
    base, target = calibrated(recorded(u, u + 0.02 * u**2 + 0.01 * u**3 + noise), core)
    effects = select_effects(core, base.simulation.context, {})
    wrong = [next(each for each in effects if each.name == name) for name in ("cubic-stiffness", "jump")]
    fit = base
    for effect in wrong:
        fit = screen_effects(fit, target, [effect])[0].fit
    misled = Hypothesis(fit, fit.score, tuple(wrong))
    found, _ = refine_by_swaps(misled, target, effects, ignore_progress)
    assert {each.name for each in found.effects} == {"cubic-stiffness", "even-nonlinearity"}
    assert found.cost < misled.cost
    assert [each.without.effects for each in found.alternatives] == [(found.effects[1],), (found.effects[0],)]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (1, 2, 3))])
def test_of_effects_that_do_the_same_the_catalogue_s_first_goes_first(seed: int) -> None:
    """Rounding does not choose: a sensor's zero and a force that is always there cannot be told apart."""
    oscillator = made()["second-order"]
    record, core = oscillator.record, oscillator.core
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(record.samples)
    base, target = calibrated(replace(record, y=record.y + 0.01 + noise), core)
    effects = select_effects(core, base.simulation.context, {})
    one, other = screen_effects(base, target, effects)[:2]
    assert (one.effect.cause, other.effect.cause) == ("offset", "input-offset")
    assert one.score_gain(base) == pytest.approx(other.score_gain(base), abs=EQUAL)
    found, _ = stepwise_search(base, (one, other), target, effects, ignore_progress)
    assert [each.name for each in found.effects] == ["offset"]


def test_what_explodes_without_an_effect_begins_anew() -> None:
    """A value that an effect has held in check need not explode the simulation that is left."""
    u = wave(3000)

    def exploding(u: Array, _dt: float, gain: float = 1.0) -> Array:
        return gain * u if gain * np.ptp(u) < 1.5 * np.ptp(wave(3000)) else np.full(u.size, np.nan)

    core = PythonFunctionSimulator(exploding, "theirs.py:exploding")
    base, target = calibrated(recorded(u, u + 0.01 * np.random.default_rng(5).standard_normal(u.size)), core)
    effect = CATALOGUE["input-gain"]
    simulation = base.simulation.with_effects((effect,))
    found = Hypothesis(evaluate_fit(simulation, target, np.array([2.0, -0.5])), 0.0, (effect,))
    without = without_effect(found, effect, target)
    assert without.fit.values == pytest.approx([1.0], rel=1e-2)
    assert np.isfinite(without.cost)


def test_a_name_that_the_simulation_fitted_anew_does_without_is_left_out() -> None:
    """It was in another minimum, or whitened by what it had not yet explained."""
    u = wave(3000)

    def scaled(u: Array, _dt: float, gain: float = 1.0) -> Array:
        return gain * u

    noise = 0.01 * np.random.default_rng(5).standard_normal(u.size)
    base, target = calibrated(
        recorded(u, 1.3 * u + noise), PythonFunctionSimulator(scaled, "theirs.py:scaled")
    )
    effects = [CATALOGUE["input-gain"], CATALOGUE["jump"]]
    fit = evaluate_fit(base.simulation.with_effects(effects[:1]), target, np.array([1.0, 0.3]))
    misled = Hypothesis(fit, fit.score, tuple(effects[:1]))
    found, _ = refine_by_swaps(misled, target, effects, ignore_progress)
    assert found.effects == ()
    assert found.fit.values == pytest.approx([1.3], rel=1e-3)
