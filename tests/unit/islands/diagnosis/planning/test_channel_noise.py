"""Noise of a channel: whitening is that of the covariance of a stationary process."""

import numpy as np
import pytest
import scipy

from support.planned import coloured_noise, noise_covariance

AUTOREGRESSIONS = [(0.97,), (-0.6,), (1.6, -0.7), (1.2, -0.5, 0.2)]


@pytest.mark.parametrize("coefficients", AUTOREGRESSIONS)
def test_whitened_squares_are_the_quadratic_form_of_the_covariance(coefficients: tuple[float, ...]) -> None:
    noise = coloured_noise(0.3, *coefficients)
    signals = np.random.default_rng(0).standard_normal((3, 50))
    covariance = noise_covariance(0.3, coefficients, 50)
    squares = [each @ scipy.linalg.solve(covariance, each) for each in signals]
    assert np.sum(noise.whiten(signals) ** 2, axis=1) == pytest.approx(squares)
    assert noise.std == pytest.approx(covariance[0, 0] ** 0.5)


@pytest.mark.parametrize("coefficients", AUTOREGRESSIONS)
def test_colour_undoes_whitening(coefficients: tuple[float, ...]) -> None:
    noise = coloured_noise(0.3, *coefficients).scale(2.0)
    signal = np.random.default_rng(1).standard_normal(50)
    assert noise.colour(noise.whiten(signal[None])[0]) * noise.std == pytest.approx(signal)


def test_the_time_constant_is_that_of_the_slowest_pole() -> None:
    slow, fast = np.exp(-1.0 / 40.0), np.exp(-1.0 / 3.0)
    assert coloured_noise(1.0, slow + fast, -slow * fast).time_constant == pytest.approx(40.0)
    assert coloured_noise(1.0, slow).scale(3.0).std == pytest.approx(3.0 / np.sqrt(1.0 - slow**2))
