"""Covariance of parameters under a coloured residual."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.covariance import long_run_variance, sandwich, sandwich_of_jacobian
from islands.estimation.estimate import estimate
from islands.estimation.least_squares import least_squares
from islands.estimation.refinement import refine
from islands.expressions.parsing import parse
from islands.models.regressor import regressor
from support.noisy_records import TERMS, coverage, make_noisy_record


def make_problem(seed=0, count=3, rows=500, pole=0.8):
    """Return a Jacobian and a residual that are both coloured."""
    noise = np.random.default_rng(seed).normal(size=(count + 1, rows))
    coloured = lfilter([1.0], [1.0, -pole], noise, axis=1)
    return coloured[:count], coloured[count]


@pytest.mark.parametrize(("pole", "tolerance"), [(0.0, 0.05), (0.5, 0.08), (0.9, 0.12), (-0.5, 0.1)])
def test_long_run_variance_of_an_autoregression(pole, tolerance):
    """The variance of the sum of n samples tends to n times that of the noise over (1 - pole)^2."""
    rows, found = 2000, []
    for seed in range(40):
        series = lfilter([1.0], [1.0, -pole], np.random.default_rng(seed).normal(size=(1, rows)), axis=1)
        found.append(long_run_variance(series - series.mean(), np.eye(1))[0][0, 0])
    assert np.mean(found) == pytest.approx(rows / (1.0 - pole) ** 2, rel=tolerance)


def test_long_run_variance_is_positive_and_follows_a_change_of_basis():
    series = make_problem(count=4)[0]
    variance, freedom = long_run_variance(series, np.eye(4))
    assert np.linalg.eigvalsh(variance).min() > 0.0
    mix = np.random.default_rng(1).normal(size=(4, 4))
    mixed, same = long_run_variance(mix @ series, np.eye(4))
    np.testing.assert_allclose(long_run_variance(series, mix.T)[0], mixed, rtol=1e-8)
    np.testing.assert_allclose(mixed, mix @ variance @ mix.T, rtol=1e-8)
    assert freedom == pytest.approx(same)


def test_covariance_of_a_jacobian_follows_a_change_of_coordinates():
    jacobian, residual = make_problem()
    mix = np.random.default_rng(1).normal(size=(3, 3))
    inverse = np.linalg.inv(mix)
    found = sandwich_of_jacobian(mix @ jacobian, residual)
    expected = inverse.T @ sandwich_of_jacobian(jacobian, residual) @ inverse
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_undetermined_coefficient_has_variance_zero():
    jacobian, residual = make_problem()
    padded = np.vstack([jacobian[:1], jacobian[:1], np.zeros((1, 500)), jacobian[1:]])
    found = sandwich_of_jacobian(padded, residual)
    kept = [0, 3, 4]
    assert not found[[1, 2]].any()
    np.testing.assert_allclose(found[np.ix_(kept, kept)], sandwich_of_jacobian(jacobian, residual), rtol=1e-9)


def test_residual_of_zero_has_covariance_zero():
    jacobian, residual = make_problem()
    assert not sandwich_of_jacobian(jacobian, 0.0 * residual).any()
    assert sandwich(np.zeros((0, 500)), residual).shape == (0, 0)


def test_scores_are_summed_over_shooting_intervals():
    """Scores that cancel within every interval contribute nothing to the error of the estimate."""
    sensitivities = np.full((1, 1000), 1.0 / np.sqrt(1000))
    residual = np.repeat(np.random.default_rng(0).normal(size=100), 10) * np.tile([1.0, -1.0], 500)
    assert sandwich(sensitivities, residual, np.full(100, 10)) < 1e-12 * sandwich(sensitivities, residual)
    few = np.full(10, 100)
    assert sandwich(sensitivities, residual, few) == sandwich(sensitivities, residual)


STRUCTURE = [regressor(parse(text))[1] for text in TERMS]


@pytest.mark.ci
@pytest.mark.parametrize(("noise", "interval"), [("equation", 20), ("equation", None), ("output", None)])
def test_refined_parameters_lie_within_two_standard_errors_as_often_as_claimed(noise, interval):
    """With the formula for a white residual the coverage under equation noise was 0.45 to 0.65."""
    found = []
    for seed in range(60):
        record = make_noisy_record(noise, seed, 1000)
        start = estimate(STRUCTURE, record).model
        found.append(refine(start, record, interval).model)
    # Of 60 intervals with a probability of 0.95, fewer than 51 contain the parameter with probability 4e-4.
    assert (coverage(found) >= 51 / 60).all()
    errors = np.mean([model.standard_errors for model in found], axis=0)
    spread = np.std([model.theta for model in found], axis=0)
    np.testing.assert_allclose(errors, spread, rtol=0.3)


def test_standard_errors_of_least_squares_under_coloured_noise():
    """The regressors are exogenous, so least squares is unbiased, but the classical formula is wrong."""
    jacobian, _ = make_problem(rows=800)
    found = [least_squares(jacobian, make_problem(seed, 3, 800)[1]) for seed in range(1, 101)]
    spread = np.std([item.theta for item in found], axis=0)
    claimed = np.sqrt(np.mean([item.standard_errors**2 for item in found], axis=0))
    np.testing.assert_allclose(claimed, spread, rtol=0.25)
    classical = np.sqrt(np.linalg.inv(jacobian @ jacobian.T).diagonal() * found[0].residual_variance)
    assert (claimed > 1.5 * classical).all()
