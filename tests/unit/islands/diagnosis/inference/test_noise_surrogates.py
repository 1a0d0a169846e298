"""Surrogates of a residual: kept and randomised properties."""

import numpy as np
import pytest

from islands.diagnosis.inference.noise_surrogates import (
    Randomisation,
    draw_surrogates,
    list_noise_models,
)

COUNT = 40


def draw(residual: np.ndarray, randomisation: Randomisation, segments: tuple[int, ...] = ()) -> np.ndarray:
    rng = np.random.default_rng(0)
    noise = list_noise_models(residual, segments)[0]
    return np.array(list(draw_surrogates(residual, noise, segments, randomisation, COUNT, rng)))


def test_random_phases_keep_the_spectrum() -> None:
    time = np.arange(1024)
    residual = np.random.default_rng(2).standard_normal(1024) + 0.4 * np.sin(2 * np.pi * time / 64)
    drawn = draw(residual, Randomisation.PHASES)
    power = np.mean(np.abs(np.fft.rfft(drawn)) ** 2, axis=0)
    assert power[16] > 10 * np.median(power)
    assert np.mean(drawn**2) == pytest.approx(np.mean(residual**2), rel=0.1)


@pytest.mark.ci
@pytest.mark.parametrize("randomisation", Randomisation)
def test_thresholds_hold_for_a_random_walk_whose_slow_part_is_absorbed(randomisation: Randomisation) -> None:
    """A calibration absorbs slow functions. What is left rarely exceeds the threshold of surrogates."""
    samples, count = 4500, 24
    absorbed = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, samples), 4))[0]
    jumps = remove(absorbed, np.arange(samples)[:, None] >= np.arange(150, samples - 150, 150))
    jumps /= np.linalg.norm(jumps, axis=0)

    def find_best_jump(signals: np.ndarray) -> np.ndarray:
        rest = remove(absorbed, signals)
        return np.max((jumps.T @ rest) ** 2, axis=0) / np.sum(rest**2, axis=0)

    alarms = 0
    for seed in range(count):
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(samples + 5))
        residual = remove(absorbed, np.convolve(walk, np.ones(6) / 6, "valid"))
        threshold = np.quantile(find_best_jump(draw(residual, randomisation).T), 0.95)
        alarms += find_best_jump(residual[:, None])[0] > threshold
    assert alarms <= 4  # 5 % are 1.2 of 24; more than 4 have a probability of 0.7 %


def remove(absorbed: np.ndarray, signals: np.ndarray) -> np.ndarray:
    return signals - absorbed @ (absorbed.T @ signals)
