"""Extended least squares: parameters under coloured noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.estimation.extended_least_squares import (
    _NoiseRegression,
    extended_least_squares,
    is_stable,
)
from islands.estimation.least_squares import least_squares
from islands.simulation.outcome import Status

UNCONSTRAINED = (np.empty((0, 2)), np.empty(0))


def make_problem(seed=0, rows=2000, noise=(0.8,), scale=0.5):
    """Return the regressors y(k-1) and u(k-1), and y, of a first-order system with coloured noise."""
    generator = np.random.default_rng(seed)
    u = generator.normal(size=rows + 1)
    v = lfilter([1.0, *noise], [1.0], scale * generator.normal(size=rows + 1))
    y = lfilter([1.0], [1.0, -0.8], np.append(0.0, 0.5 * u[:-1]) + v)
    return np.array([y[:-1], u[:-1]]), y[1:]


def estimate(psi, y, S=UNCONSTRAINED[0], c=UNCONSTRAINED[1], segments=None):
    return extended_least_squares(psi, y, S, c, np.array(segments or [y.size]))


def test_noise_terms_remove_the_bias_of_least_squares():
    found, biased = [], []
    for seed in range(20):
        psi, y = make_problem(seed)
        biased.append(least_squares(psi, y).theta)
        found.append(estimate(psi, y))
    theta = np.array([item.estimate.theta for item in found])
    errors = np.array([item.estimate.standard_errors for item in found])
    assert np.mean(biased, axis=0)[0] - 0.8 > 10.0 * errors[:, 0].mean() / np.sqrt(20)
    assert (np.abs(theta.mean(axis=0) - [0.8, 0.5]) < 3.0 * errors.mean(axis=0) / np.sqrt(20)).all()
    np.testing.assert_allclose(errors.mean(axis=0), theta.std(axis=0), rtol=0.4)
    noise = np.mean([item.noise[0] for item in found])
    assert noise == pytest.approx(0.8, abs=0.02)
    variance = np.mean([item.estimate.residual_variance for item in found])
    assert variance == pytest.approx(0.25, rel=0.03)


def test_constraints_that_determine_all_parameters_leave_nothing_to_estimate():
    psi, y = make_problem()
    found = estimate(psi, y, np.eye(2), np.array([0.8, 0.5]))
    np.testing.assert_allclose(found.estimate.theta, [0.8, 0.5], rtol=1e-12)
    assert (found.noise, found.estimate.standard_errors.tolist()) == ((), [0.0, 0.0])


def test_failures_are_those_of_constrained_least_squares():
    psi, y = make_problem()
    dependent = np.vstack([psi, psi[:1]])
    S, c = np.empty((0, 3)), np.empty(0)
    assert estimate(dependent, y, S, c) == constrained_least_squares(dependent, y, S, c).outcome
    assert estimate(psi[:, :2], y[:2]).verdict is Status.TOO_FEW_ROWS
    S, c = np.zeros((1, 2)), np.zeros(1)
    assert estimate(psi, y, S, c).verdict is Status.INFEASIBLE


def test_segments_are_filtered_separately():
    """A first recording of one row only shifts the start of the recursion."""
    psi, y = make_problem()
    joined = np.hstack([psi[:, :1], psi]), np.append(y[0], y)
    found = estimate(*joined, segments=[1, y.size])
    np.testing.assert_allclose(found.estimate.theta, estimate(psi, y).estimate.theta, atol=2e-3)
    swapped = np.roll(np.arange(y.size), 700)
    parts = estimate(psi[:, swapped], y[swapped], segments=[700, y.size - 700])
    np.testing.assert_allclose(
        parts.estimate.theta, estimate(psi, y, segments=[y.size - 700, 700]).estimate.theta, rtol=1e-6
    )


def test_sensitivities_are_the_derivatives_of_the_prediction():
    psi, y = make_problem(rows=60)
    regression = _NoiseRegression(psi, y, np.array([25, 60]))
    at = np.array([0.7, 0.4, 0.5, -0.2])
    sensitivities, error = regression(at)
    for position, step in enumerate(1e-6 * np.eye(4)):
        difference = (regression(at + step)[1] - regression(at - step)[1]) / 2e-6
        np.testing.assert_allclose(sensitivities[position], -difference, atol=1e-7)
    assert error[0] == pytest.approx(y[0] - at[:2] @ psi[:, 0])
    assert error[25] == pytest.approx(y[25] - at[:2] @ psi[:, 25])


@pytest.mark.parametrize("roots", [[0.5], [-0.95, 0.3], [1.05, 0.2], [0.9j, -0.9j], [1.1j, -1.1j], [-1.2]])
def test_stability_agrees_with_the_roots(roots):
    coefficients = np.real(np.poly(roots))[1:]
    assert is_stable(coefficients) == (np.abs(roots).max() < 1.0)
