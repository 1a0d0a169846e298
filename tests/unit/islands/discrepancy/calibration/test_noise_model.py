"""Noise with a memory: its order, its coefficients and what whitening leaves."""

import numpy as np
import pytest
import scipy

from islands.discrepancy.calibration.noise_model import fit_ar_noise


@pytest.mark.parametrize("poles", [(), (0.9,), (0.6, 0.3), (0.95, -0.4)])
def test_an_autoregression_is_found_again(poles: tuple[float, ...]) -> None:
    coefficients = -np.poly(poles)[1:] if poles else np.zeros(0)
    white = np.random.default_rng(1).standard_normal(20_000)
    residual = scipy.signal.lfilter([1.0], np.concatenate([[1.0], -coefficients]), white)
    noise = fit_ar_noise(residual)
    assert noise.order == len(poles)
    assert noise.coefficients == pytest.approx(coefficients, abs=0.03)
    assert noise.variance == pytest.approx(1.0, rel=0.03)
    assert np.std(noise.whiten(residual)) == pytest.approx(1.0, rel=0.03)


def test_white_noise_is_left_as_it_is() -> None:
    white = np.random.default_rng(2).standard_normal(1000)
    assert np.array_equal(fit_ar_noise(white).whiten(white), white)
