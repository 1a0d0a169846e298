"""Effective sample size of a residual."""

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.records.noise_model import estimate_effective_samples

N = 4000


def ar1_noise(a: float, seed: int, samples: int = N) -> NDArray[np.float64]:
    noise = np.random.default_rng(seed).standard_normal(samples + 500)
    return scipy.signal.lfilter([1.0], [1.0, -a], noise)[500:]


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9, -0.7])
def test_effective_samples_of_an_autoregression_follow_bartlett(a: float) -> None:
    """Bartlett's sum of rho^2 is (1 + a^2) / (1 - a^2).

    The estimate is two thirds of n over that sum, since it also sums the squares of random correlations over
    a quarter of all lags. This is on the safe side.
    """
    estimate = np.mean([estimate_effective_samples(ar1_noise(a, seed)) for seed in range(20)])
    squares = (1 + a * a) / (1 - a * a)
    assert estimate == pytest.approx(N / (squares * 1.44), rel=0.1)
    assert estimate < N / squares


@pytest.mark.parametrize("residual", [np.zeros(500), np.full(500, 3.0), np.sin(0.05 * np.arange(500))])
def test_effective_samples_are_at_least_ten(residual: NDArray[np.float64]) -> None:
    assert 10.0 <= estimate_effective_samples(residual) <= 500.0
