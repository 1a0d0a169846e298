"""Effects that oppose each other are one finding; each of a pair gains without the other one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

import islands
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference import cancellation
from islands.diagnosis.inference.cancellation import (
    MAX_CANCELLED,
    MAX_OPPOSED,
    measure_cancellation,
    resolve_cancellation,
)
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import bic_penalty
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, Site
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import RecordedOutput

SAMPLES = 800


def make_power(name: str, power: float) -> Effect:
    """Return an effect that adds an odd power of the input to the output."""
    return Effect(
        name=name,
        summary="an odd power",
        family="shape",
        site=Site.OUTPUT,
        parameters=lambda _: (Parameter("k", "", 0.0, 0.01),),
        starting_points=lambda _context, _residual: ((0.1,),),
        form=lambda y, values, context: y + values[0] * np.sign(context.u) * np.abs(context.u) ** power,
        source="none",
    )


QUADRATIC, CUBIC, OFFSET = make_power("quadratic", 2.0), make_power("cubic", 3.0), CATALOGUE["offset"]


def suppose(seed: int, effects: tuple[Effect, Effect], first: float) -> tuple[Hypothesis, Target]:
    """Return a hypothesis with two effects, the first of a given strength, of a record with a cubic error."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1.0, 1.0, SAMPLES)
    shift = 0.1 if OFFSET in effects else 0.0
    record = Dataset(u, u + 0.2 * u**3 + shift + 0.01 * rng.standard_normal(SAMPLES), 0.1)
    simulator, target = RecordedOutput("theirs", u), make_target(record, 600, {})
    simulation = ExtendedSimulator(simulator, effects, make_context(record, simulator, 600))
    is_fixed = np.array([True, False])
    found = calibrate(simulation, target, np.array([first, 0.0]), is_fixed=is_fixed)
    return Hypothesis(found, found.score + sum(bic_penalty(each, found) for each in effects), effects), target


@pytest.mark.parametrize("seed", range(5))
def test_effects_of_opposite_signs_are_one_finding(seed: int) -> None:
    """A quadratic error of 2, less a cubic one, is what a cubic one of 0.2 explains."""
    hypothesis, target = suppose(seed, (QUADRATIC, CUBIC), 2.0)
    assert hypothesis.fit.values[1] < -1.5
    assert measure_cancellation(hypothesis, (QUADRATIC, CUBIC), target) < MAX_CANCELLED
    kept, removed = resolve_cancellation(hypothesis, target, np.random.default_rng(0))
    assert kept.effects == (CUBIC,)
    assert kept.fit.values == pytest.approx([0.2], abs=0.05)
    assert removed == {"cubic": ("quadratic",)}


@pytest.mark.parametrize("seed", range(5))
def test_opposed_effects_have_to_gain_without_each_other(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both do here; it is the rule for effects that cancel less, unless the residual is model error."""
    monkeypatch.setattr(cancellation, "MAX_CANCELLED", 0.0)
    hypothesis, target = suppose(seed, (QUADRATIC, CUBIC), 2.0)
    assert resolve_cancellation(hypothesis, target, np.random.default_rng(0))[0] is hypothesis
    monkeypatch.setattr(cancellation, "cross_validate_gain", lambda *_: -1.0)
    kept, _ = resolve_cancellation(hypothesis, target, np.random.default_rng(0))
    assert kept.effects == (CUBIC,)
    with_model_error = replace(target, effective_samples=100.0)
    assert resolve_cancellation(hypothesis, with_model_error, np.random.default_rng(0))[0] is hypothesis


@pytest.mark.parametrize("seed", range(5))
def test_opposed_effects_that_only_together_leave_white_noise_are_two(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cancellation, "cross_validate_gain", lambda *_: -1.0)
    rng = np.random.default_rng(seed)
    u = np.sin(0.02 * np.arange(SAMPLES)) + np.sin(0.0334 * np.arange(SAMPLES))
    error = 0.3 * u**3 - 0.4 * np.abs(u) * u
    record = Dataset(u, u + error + 0.01 * rng.standard_normal(SAMPLES), 0.1)
    simulator, target, effects = RecordedOutput("theirs", u), make_target(record, 600, {}), (QUADRATIC, CUBIC)
    simulation = ExtendedSimulator(simulator, effects, make_context(record, simulator, 600))
    found = calibrate(simulation, target, simulation.nominal)
    penalties = sum(bic_penalty(each, found) for each in effects)
    hypothesis = Hypothesis(found, found.score + penalties, effects)
    assert MAX_CANCELLED < measure_cancellation(hypothesis, effects, target) < MAX_OPPOSED
    assert resolve_cancellation(hypothesis, target, rng) == (hypothesis, {})


@pytest.mark.nightly
def test_causes_of_a_diagnosis_do_not_cancel() -> None:
    """An input between samples that no intersample behaviour has is made up for by creeps of both signs."""
    rng = np.random.default_rng([0, *map(ord, "osc_fine")])
    time = np.arange(20000) * 0.001
    u = sum(
        rng.uniform(0.2, 1.0) * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.28))
        for f in rng.uniform(0.2, 6.0, 8)
    )
    matrices = (
        np.array([[0.0, 1.0], [-400.0, -4.0]]),
        np.array([[0.0], [1.0]]),
        np.eye(1, 2),
        np.zeros((1, 1)),
    )
    _, y, _ = lsim(matrices, u, time)
    found = islands.diagnose(Dataset(u[::10], y[::10], 0.01), "second-order")
    assert not {"exponential-creep", "logarithmic-creep"} <= {each.name for each in found.causes}
