"""Detectors: each finds what was done to a record's samples, and nothing where nothing was done."""

import numpy as np
import pytest
import scipy

from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.stepwise_search import LEAST
from islands.discrepancy.interfaces.effect import SimulationContext

SAMPLES, SIGMA = 4000, 0.14


def scene() -> SimulationContext:
    u = np.zeros(SAMPLES)
    return SimulationContext(u, 0.01, {}, {}, 40.0, 45.0, "V", "um", 40.0)


def clean(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    mean = 45 * np.sin(2 * np.pi * 0.37 * np.arange(SAMPLES) * 0.01)
    return mean, mean + SIGMA * rng.standard_normal(SAMPLES)


def rounded(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.round(y / (2 * SIGMA)) * 2 * SIGMA


def held(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    y = y.copy()
    for first in rng.integers(10, SAMPLES - 20, 5):
        y[first : first + 8] = y[first]
    return y


def spiked(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    y = y.copy()
    y[rng.choice(SAMPLES, 8, replace=False)] += 12 * SIGMA * rng.choice([-1, 1], 8)
    return y


def louder(rng: np.random.Generator, mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return mean + (y - mean) * (1 + 2 * np.abs(mean) / 45)


def coloured(rng: np.random.Generator, mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return mean + scipy.signal.lfilter([np.sqrt(1 - 0.8**2)], [1.0, -0.8], y - mean)


DONE = {
    "quantisation": rounded,
    "held-samples": held,
    "outliers": spiked,
    "heteroscedastic-noise": louder,
    "coloured-noise": coloured,
}


def said(y: np.ndarray, residual: np.ndarray) -> set[str]:
    found = {}
    for name, detector in DETECTORS.items():
        detection = detector.detect(y, residual, scene())
        if (
            detection is not None
            and detection.score_gain > LEAST
            and not found.keys() & set(detector.excluded_by)
        ):
            found[name] = detection
    return set(found)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", DONE)
def test_what_was_done_is_found_and_nothing_else(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(name)])
    mean, y = clean(rng)
    y = DONE[name](rng, mean, y)
    assert said(y, y - mean) == {name}


@pytest.mark.parametrize("seed", range(20))
def test_on_a_clean_record_they_are_silent(seed: int) -> None:
    mean, y = clean(np.random.default_rng(seed))
    assert said(y, y - mean) == set()


def test_every_detector_is_tried() -> None:
    assert DONE.keys() == DETECTORS.keys()
