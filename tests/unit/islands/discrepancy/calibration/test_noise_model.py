"""Autoregressive noise model: order, coefficients and whitening."""

import numpy as np
import pytest
import scipy

from islands.discrepancy.calibration.noise_model import fit_ar_noise


@pytest.mark.parametrize("poles", [(), (0.9,), (0.6, 0.3), (0.95, -0.4)])
def test_order_and_coefficients_of_an_autoregression_are_recovered(poles: tuple[float, ...]) -> None:
    coefficients = -np.poly(poles)[1:] if poles else np.zeros(0)
    white = np.random.default_rng(1).standard_normal(20_000)
    residual = scipy.signal.lfilter([1.0], np.concatenate([[1.0], -coefficients]), white)
    noise = fit_ar_noise(residual)
    assert noise.order == len(poles)
    assert noise.coefficients == pytest.approx(coefficients, abs=0.03)
    assert noise.variance == pytest.approx(1.0, rel=0.03)
    assert np.std(noise.whiten(residual)) == pytest.approx(1.0, rel=0.03)


def test_whitening_does_not_change_white_noise() -> None:
    white = np.random.default_rng(2).standard_normal(1000)
    assert np.array_equal(fit_ar_noise(white).whiten(white), white)
