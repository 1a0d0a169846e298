"""Analyses of a residual: none of them reaches from one recording into the next."""

from itertools import pairwise

import numpy as np
import pytest
import scipy

from islands.discrepancy.inference.noise_detectors import DETECTORS, NoiseFinding
from islands.discrepancy.inference.noise_floor import explainable_variance, noise_variance_from_periods
from islands.discrepancy.inference.stepwise_search import MIN_GAIN
from islands.discrepancy.interfaces.context import SimulationContext
from islands.discrepancy.simulators.coordinates import input_coordinate, output_coordinate

LENGTHS = (400, 300, 300)

SAMPLES = sum(LENGTHS)


def make_context(u: np.ndarray, lengths: tuple[int, ...] = LENGTHS) -> SimulationContext:
    return SimulationContext(u, 0.01, {}, {}, 1.0, 1.0, "V", "um", u.size * 0.01, segments=lengths)


def draw_inputs(seed: int = 1) -> list[np.ndarray]:
    """Draw slow inputs at different levels, so that a boundary is a large step."""
    rng = np.random.default_rng(seed)
    return [
        10.0 * number + scipy.signal.lfilter([0.02], [1.0, -0.98], rng.standard_normal(length))
        for number, length in enumerate(LENGTHS)
    ]


def detect(name: str, y: np.ndarray, residual: np.ndarray, lengths: tuple[int, ...]) -> NoiseFinding | None:
    found = DETECTORS[name].detect(y, residual, make_context(np.zeros(y.size), lengths))
    return found if found is not None and found.score_gain > MIN_GAIN else None


@pytest.mark.parametrize("make", [input_coordinate, output_coordinate])
def test_typical_rate_is_that_within_the_recordings(make: object) -> None:
    parts = draw_inputs()
    expected = np.std(np.concatenate([np.diff(part) for part in parts])) / 0.01
    signal = np.concatenate(parts)
    assert make(make_context(signal), signal).rate == pytest.approx(expected)


def test_lost_samples_end_with_a_recording() -> None:
    rng = np.random.default_rng(2)
    parts = [rng.standard_normal(length) for length in LENGTHS]
    for first, second in pairwise(parts):
        first[-2:] = second[:2] = 0.25  # two equal samples on either side are no burst of four
    y = np.concatenate(parts)
    assert detect("held-samples", y, y, (SAMPLES,)) is not None
    assert detect("held-samples", y, y, LENGTHS) is None


def test_first_samples_of_recordings_are_no_outliers() -> None:
    rng = np.random.default_rng(3)
    lengths = (100,) * 10
    drawn = rng.standard_normal((10, 1500))
    slow = scipy.signal.lfilter([1.0], [1.0, -0.995], drawn, axis=1)[:, -100:].ravel()
    assert detect("outliers", slow, slow, (1000,)) is not None
    assert detect("outliers", slow, slow, lengths) is None
    assert detect("heteroscedastic-noise", np.ones(1000), slow, lengths) is None


def test_noise_of_periods_is_measured_within_recordings() -> None:
    rng = np.random.default_rng(4)
    u = np.concatenate([np.resize(rng.standard_normal(period), 300) for period in (50, 64, 140)])
    noise = 0.1 * rng.standard_normal(u.size)
    drift = np.repeat([0.0, 7.0, -3.0], 300)
    assert noise_variance_from_periods(u, u + noise + drift) is None
    found = noise_variance_from_periods(u, u + noise + drift, (300, 300, 300))
    assert found == pytest.approx(0.01, rel=0.2)
    # The last recording has two periods only.
    y = u + noise
    y[600:] += 5.0 * rng.standard_normal(300)
    assert noise_variance_from_periods(u, y, (300, 300, 300)) == pytest.approx(found, rel=0.1)


def test_past_of_another_recording_does_not_explain_a_residual() -> None:
    parts = draw_inputs()
    u = np.concatenate(parts)
    # What the end of a recording leaves behind in a joined record decays in the next one.
    left_behind = scipy.signal.lfilter([0.05], [1.0, -0.95], u - u[0])
    left_behind -= np.concatenate(
        [scipy.signal.lfilter([0.05], [1.0, -0.95], part - part[0]) for part in parts]
    )
    residual = left_behind + 0.1 * np.random.default_rng(5).standard_normal(SAMPLES)
    across = explainable_variance(residual, u, u, np.random.default_rng(0))
    within = explainable_variance(residual, u, u, np.random.default_rng(0), LENGTHS)
    assert within < across
