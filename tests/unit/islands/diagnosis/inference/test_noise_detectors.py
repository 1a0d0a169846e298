"""Noise detectors: each finds its artefact, and none reports anything on a clean record."""

import numpy as np
import pytest
import scipy

from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.effects.interface.context import SimulationContext

SAMPLES = 4000

#: Standard deviation of the noise.
SIGMA = 0.14


def make_context() -> SimulationContext:
    u = np.zeros(SAMPLES)
    return SimulationContext(u, 0.01, {}, {}, 40.0, 45.0, "V", "um", 40.0)


def make_clean_record(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    mean = 45 * np.sin(2 * np.pi * 0.37 * np.arange(SAMPLES) * 0.01)
    return mean, mean + SIGMA * rng.standard_normal(SAMPLES)


def quantise(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.round(y / (2 * SIGMA)) * 2 * SIGMA


def hold_samples(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    y = y.copy()
    for first in rng.integers(10, SAMPLES - 20, 5):
        y[first : first + 8] = y[first]
    return y


def add_outliers(rng: np.random.Generator, _mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    y = y.copy()
    y[rng.choice(SAMPLES, 8, replace=False)] += 12 * SIGMA * rng.choice([-1, 1], 8)
    return y


def scale_noise(rng: np.random.Generator, mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return mean + (y - mean) * (1 + 2 * np.abs(mean) / 45)


def change_noise(rng: np.random.Generator, mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return mean + (y - mean) * np.geomspace(1.0, 4.0, SAMPLES)


def colour_noise(rng: np.random.Generator, mean: np.ndarray, y: np.ndarray) -> np.ndarray:
    return mean + scipy.signal.lfilter([np.sqrt(1 - 0.8**2)], [1.0, -0.8], y - mean)


ARTEFACTS = {
    "quantisation": quantise,
    "held-samples": hold_samples,
    "outliers": add_outliers,
    "heteroscedastic-noise": scale_noise,
    "changing-noise": change_noise,
    "coloured-noise": colour_noise,
}


def detect_all(y: np.ndarray, residual: np.ndarray) -> set[str]:
    found = {}
    for name, detector in DETECTORS.items():
        detection = detector.detect(y, residual, make_context())
        if (
            detection is not None
            and detection.score_gain > MIN_GAIN
            and not found.keys() & set(detector.excluded_by)
        ):
            found[name] = detection
    return set(found)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", ARTEFACTS)
def test_only_the_detector_of_the_artefact_reports(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, len(name)])
    mean, y = make_clean_record(rng)
    y = ARTEFACTS[name](rng, mean, y)
    assert detect_all(y, y - mean) == {name}


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("factor", [1.0, 100.0, 300.0])
def test_detectors_report_nothing_on_a_clean_record(seed: int, factor: float) -> None:
    """Large noise makes the measured output large where the noise is: that is no dependence on the output."""
    mean, y = make_clean_record(np.random.default_rng(seed))
    noise = factor * (y - mean)
    assert detect_all(mean + noise, noise) == set()
