"""Noise model: orders, coefficients and whitening, also of several recordings."""

import numpy as np
import pytest
import scipy

from islands.records.noise_model import (
    NoiseModel,
    fit_noise,
)
from lab.diagnosis.injection.noise import NOISES


@pytest.mark.parametrize("poles", [(), (0.9,), (0.6, 0.3), (0.95, -0.4)])
def test_order_and_coefficients_of_an_autoregression_are_recovered(poles: tuple[float, ...]) -> None:
    coefficients = -np.poly(poles)[1:] if poles else np.zeros(0)
    white = np.random.default_rng(1).standard_normal(20_000)
    residual = scipy.signal.lfilter([1.0], np.concatenate([[1.0], -coefficients]), white)
    noise = fit_noise(residual)
    assert noise.order == len(poles)
    assert noise.coefficients == pytest.approx(coefficients, abs=0.03)
    assert noise.variance == pytest.approx(1.0, rel=0.03)
    assert np.std(noise.whiten(residual)) == pytest.approx(1.0, rel=0.03)


#: Lengths of recordings whose residuals have different means, so that a boundary is a large step.
LENGTHS = (300, 200, 100)


def draw_recordings() -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [
        scipy.signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal(length)) + 20.0 * number
        for number, length in enumerate(LENGTHS)
    ]


def test_whitening_of_a_recording_does_not_depend_on_the_others() -> None:
    noise = NoiseModel(np.array([0.9, -0.2]), 1.0, 600.0)
    parts = draw_recordings()
    whitened = noise.whiten(np.concatenate(parts), LENGTHS)
    assert whitened.tolist() == np.concatenate([noise.whiten(part) for part in parts]).tolist()


def test_autoregression_is_the_least_squares_fit_within_the_recordings() -> None:
    parts = draw_recordings()
    equations = np.concatenate(
        [np.column_stack([part[2:-1], part[1:-2], part[:-3], part[3:]]) for part in parts]
    )
    noise = fit_noise(np.concatenate(parts), 3, LENGTHS)
    expected = np.linalg.lstsq(equations[:, : noise.order], equations[:, 3], rcond=None)[0]
    assert noise.order > 0
    assert noise.coefficients == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("difference_order", [0.0, 0.25, 0.5])
def test_innovations_are_recovered_from_coloured_noise(difference_order: float) -> None:
    noise = NoiseModel(np.array([0.5, 0.2]), 1.0, 500.0, difference_order)
    innovations = np.random.default_rng(4).standard_normal(500)
    assert noise.whiten(noise.colour(innovations)) == pytest.approx(innovations, abs=1e-9)


def test_long_memory_is_recognised_by_its_spectrum() -> None:
    """Noise with a spectrum of 1/f has order 0.5; an autoregression has no fractional difference."""
    pink = NOISES["pink"](np.random.default_rng(6), np.ones(3000))
    found = fit_noise(pink)
    assert found.difference_order == 0.5
    power = np.abs(np.fft.rfft(found.whiten(pink))) ** 2
    assert np.mean(power[1:20]) < 3.0 * np.mean(power)
    assert fit_noise(NOISES["ar"](np.random.default_rng(6), np.ones(3000))).difference_order == 0.0
