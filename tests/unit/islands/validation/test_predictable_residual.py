"""Predictable share of a residual: near 0 for noise, near 1 for structure, independent of units and size."""

import numpy as np
import pytest

from islands.validation.predictable_residual import measure_structure, predictable_share

RNG = np.random.default_rng(3)
U = RNG.uniform(-1, 1, (2000, 1))
WHITE = RNG.standard_normal(2000)
Y = RNG.standard_normal(2000)


def moving_average(noise, coefficient=-0.9):
    return noise + coefficient * np.concatenate([[0.0], noise[:-1]])


@pytest.mark.parametrize("samples", [3, 10, 40, 200, 2000])
def test_white_noise_is_hardly_predictable(samples):
    assert predictable_share(WHITE[:samples], U[:samples], Y[:samples]) < 0.05


@pytest.mark.parametrize(
    "missing",
    [U[:, 0] - U.mean(), U[:, 0] ** 2 - np.mean(U**2), np.roll(U[:, 0], 3)],
    ids=["u", "u^2", "lag"],
)
def test_the_share_is_the_fraction_of_the_mean_square(missing):
    for noise in (0.3, 3.0):
        residual = missing / missing.std() + noise * WHITE
        assert predictable_share(residual, U, Y) == pytest.approx(1 / (1 + noise**2), abs=0.06)


def test_a_coloured_residual_is_predictable_at_two_levels_of_the_output():
    level = np.where(np.arange(2000) < 1000, 0.0, 10.0)
    y, u = level + 0.1 * Y, level[:, None] + 0.1 * U
    coloured = WHITE.copy()
    for k in range(1, len(coloured)):
        coloured[k] += 0.9 * coloured[k - 1]
    assert predictable_share(coloured, u, y) == pytest.approx(0.81, abs=0.05)
    assert predictable_share(WHITE, u, y) < 0.02


def test_the_share_does_not_depend_on_units_or_on_the_number_of_threads():
    residual = moving_average(WHITE) + U[:, 0]
    share = predictable_share(residual, U, Y)
    assert predictable_share(1e200 * residual, 1e-200 * U, Y) == pytest.approx(share)
    assert predictable_share(1e-300 * residual, U + 1e3, Y) == pytest.approx(share, abs=1e-3)


def test_inputs_with_dependent_lags_are_no_exception():
    sine = np.sin(np.arange(2000) / 7)[:, None]
    assert predictable_share(WHITE, sine, Y) < 0.02
    assert predictable_share(sine[:, 0] + 0.01 * WHITE, sine, Y) > 0.99
    assert predictable_share(WHITE, np.ones((2000, 20)), Y) < 0.02


@pytest.mark.parametrize(
    ("one_step", "free_run", "verdict"),
    [
        (WHITE, np.cumsum(WHITE), "inadequate"),  # equation noise: a simulation drifts
        (moving_average(WHITE), WHITE, "adequate"),  # measurement noise
        (U[:, 0], 0.02 * U[:, 0], "minor"),
        (U[:, 0], 0.05 * U[:, 0], "inadequate"),
        (WHITE, None, "inadequate"),
        (None, None, "inadequate"),
        (1e-9 * U[:, 0], 1e-6 * U[:, 0], "adequate"),  # rounding
    ],
)
def test_the_verdict_has_three_levels(one_step, free_run, verdict):
    found = measure_structure(one_step, free_run, U, Y, output_range=2.0)
    assert found.verdict == verdict


def test_the_predictable_part_is_given_in_per_cent_of_the_output_range():
    found = measure_structure(WHITE, 0.02 * U[:, 0] + 0.02, U, Y, output_range=2.0)
    assert found.percent == pytest.approx(100 * 0.02 * np.sqrt(1 / 3 + 1) / 2, rel=0.03)
    assert found.free_run_share == pytest.approx(1.0, abs=1e-6)
    assert np.isnan(measure_structure(WHITE, None, U, Y, 2.0).percent)
