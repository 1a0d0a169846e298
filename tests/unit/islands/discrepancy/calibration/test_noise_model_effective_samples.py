"""How many samples that know nothing of each other a residual is worth."""

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from islands.discrepancy.calibration.noise_model import effective_samples, white_noise

N = 4000


def remembering(a: float, seed: int, samples: int = N) -> NDArray[np.float64]:
    noise = np.random.default_rng(seed).standard_normal(samples + 500)
    return scipy.signal.lfilter([1.0], [1.0, -a], noise)[500:]


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9, -0.7])
def test_it_is_that_of_the_autoregression(a: float) -> None:
    """Bartlett's sum of rho^2 is (1 + a^2) / (1 - a^2).

    What it says is two thirds of n over that: over a quarter of all lags the squares of chance are summed as
    well, which is on the safe side.
    """
    found = np.mean([effective_samples(remembering(a, seed)) for seed in range(20)])
    spread = (1 + a * a) / (1 - a * a)
    assert found == pytest.approx(N / (spread * 1.44), rel=0.1)
    assert found < N / spread


def test_it_knows_no_unit_and_no_level() -> None:
    residual = remembering(0.8, 3)
    known = effective_samples(residual)
    assert effective_samples(1e-6 * residual) == pytest.approx(known, rel=1e-9)
    assert effective_samples(residual + 7.0) == pytest.approx(known, rel=1e-6)


@pytest.mark.parametrize("residual", [np.zeros(500), np.full(500, 3.0), np.sin(0.05 * np.arange(500))])
def test_it_is_ten_at_least(residual: NDArray[np.float64]) -> None:
    assert 10.0 <= effective_samples(residual) <= 500.0


def test_white_noise_of_nothing_has_a_likelihood() -> None:
    assert np.isfinite(white_noise(0.0, 100.0).minus_twice_log_likelihood)
