"""The explainable part of a residual, period detection, and the noise variance from repeated periods."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.diagnosis.inference.noise_floor import (
    MIN_FRACTION,
    detect_period,
    explainable_variance,
    noise_variance_from_periods,
)
from lab.diagnosis.injection.noise import NOISES

Array = NDArray[np.float64]


def periodic(period: int, samples: int, seed: int = 0) -> Array:
    """Return a periodic signal with random values and no shorter period."""
    values = np.random.default_rng(seed).standard_normal(period)
    return np.resize(values, samples)


@pytest.mark.parametrize(("noise", "is_explained"), [("pink", False), ("brown", False), ("white", True)])
def test_mean_of_a_residual_is_explained_only_where_noise_has_none(noise: str, is_explained: bool) -> None:
    for seed in (1, 2, 7):
        rng = np.random.default_rng(seed)
        u = scipy.signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal(1000))
        y = scipy.signal.lfilter([0.05], [1.0, -0.95], u)
        residual = 1.0 + NOISES[noise](rng, y)
        explained = explainable_variance(residual, u, y, np.random.default_rng(0))
        assert explained > 0.8 if is_explained else explained < MIN_FRACTION


@given(st.floats(0.01, 100.0), st.integers(0, 20))
def test_period_detection_ignores_the_unit_and_small_deviations(size: float, seed: int) -> None:
    u = periodic(64, 500, seed)
    deviation = 2e-4 * np.random.default_rng(seed).standard_normal(u.size)
    assert detect_period(size * (u + deviation)) == 64


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sigma", [1e-4, 0.3, 20.0])
def test_noise_variance_is_within_its_sampling_error(sigma: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = periodic(80, 2000)
    y = 5 * np.tanh(u) + np.roll(u, 3) + sigma * rng.standard_normal(u.size)
    y[:80] += 100.0 * np.exp(-np.arange(80) / 9.0)  # transient
    found = noise_variance_from_periods(u, y)
    # 23 differences of 80 samples; successive differences share a period, and each loses its mean.
    expected, chance = sigma**2 * (1 - 1 / 80), 4 * (3 / (23 * 80)) ** 0.5
    assert found == pytest.approx(expected, rel=chance)
