"""Thresholds of gains: noise seldom reaches them, effects exceed them."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.chance_gain import ForwardSelection, compute_chance_gain, draw_noise
from islands.diagnosis.inference.screening import bic_penalty, screen_effects
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.records.noise_model import estimate_effective_samples
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import RecordedOutput
from lab.diagnosis.injection.noise import NOISES
from support.simulated_records import recorded, wave

EFFECTS = [CATALOGUE[name] for name in ("linear-drift", "jump", "exponential-creep", "even-nonlinearity")]


def calibrated(noise: np.ndarray, has_model_error: bool = False):
    u = wave(noise.size)
    record = recorded(u, u + noise)
    fitted = count_fitted_samples(record)
    simulator = RecordedOutput("theirs", u)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, fitted))
    target = Target(record.y, np.arange(record.samples) < fitted, None, {}, fitted=fitted)
    if has_model_error:
        residual = target.residual(u)
        target = replace(target, effective_samples=estimate_effective_samples(residual))
    return calibrate(simulation, target, simulation.nominal), target


def measure_gain(noise: np.ndarray, effect: Effect) -> tuple[float, float]:
    """Return the gain of an effect, and the gain that it reaches by chance."""
    base, target = calibrated(noise)
    fit = screen_effects(base, target, DiagnosisRun([effect]))[0].fit
    if target.effective_samples is None:
        target = replace(target, noise=fit.noise)
    surrogates = draw_noise(fit if target.effective_samples is None else base, target)
    return base.score - fit.score, compute_chance_gain(fit, base, effect, target, len(EFFECTS), surrogates)


@pytest.mark.ci
@pytest.mark.parametrize(
    "kind",
    [
        "pink",
        *(
            pytest.param(kind, marks=pytest.mark.nightly)
            for kind in ("white", "slow-ar", "multiplicative", "brown", "heavy-tailed")
        ),
    ],
)
def test_noise_does_not_reach_its_own_threshold(kind: str) -> None:
    for seed in range(2):
        noise = NOISES[kind](np.random.default_rng(seed), wave(800))
        for effect in EFFECTS:
            gain, chance = measure_gain(noise, effect)
            base, _ = calibrated(noise)
            assert gain < max(chance, 6.0 + bic_penalty(effect, base)), (effect.name, seed)


# In records of these seeds, the drift exceeds the threshold of an autoregression.
@pytest.mark.parametrize("seed", [1, 11])
def test_drift_does_not_exceed_the_threshold_of_a_short_random_walk(seed: int) -> None:
    noise = NOISES["brown"](np.random.default_rng(seed), wave(500))
    gain, chance = measure_gain(noise, CATALOGUE["linear-drift"])
    assert gain < chance


def test_forward_selection_separates_two_effects_from_slow_noise() -> None:
    time = np.arange(800) / 800
    slow = NOISES["slow-ar"](np.random.default_rng(3), wave(800))
    effects = 4.0 * (time > 0.4) + wave(800) ** 2
    for noise, is_found in ((slow, False), (0.5 * slow + effects, True)):
        base, target = calibrated(noise, has_model_error=True)
        selection = ForwardSelection(base, target, EFFECTS, 2)
        assert (selection.compute_gain() > selection.compute_chance_gain()) == is_found
