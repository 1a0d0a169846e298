"""Frequency response: exact of periodic data, and free of the transients of any record."""

import numpy as np
import pytest

from islands.estimation.linear.frequency_response import estimate_response

A = np.array([[0.5, 0.6, 0.0], [-0.6, 0.5, 0.0], [0.0, 0.0, 0.4]])
B = np.array([[1.0, 0.3], [0.2, -0.8], [0.5, 0.5]])
C = np.array([[1.0, 0.4, 0.2], [0.3, -1.0, 0.6]])


def simulate(u):
    x, y = np.zeros(3), np.empty((len(u), 2))
    for row, inputs in enumerate(u):
        y[row] = C @ x
        x = A @ x + B @ inputs
    return y


def respond(frequencies):
    return C @ np.linalg.solve(np.exp(1j * frequencies)[:, None, None] * np.eye(3) - A, B + 0j)


def test_a_record_that_begins_and_ends_anywhere_shows_the_response():
    u = np.random.default_rng(3).standard_normal((2200, 2))
    y = simulate(u)[200:]
    found = estimate_response(u[200:].reshape(1, -1, 2), y.reshape(1, -1, 2))
    true = respond(found.frequencies)
    assert np.abs(found.values - true).max() < 0.02 * np.abs(true).max()
    assert np.sqrt(found.variances).max() < 2e-3


def test_the_variance_of_a_line_is_that_of_the_noise():
    rng = np.random.default_rng(4)
    u = rng.standard_normal((8, 512, 2))
    y = np.stack([simulate(each) for each in u]) + 0.1 * rng.standard_normal((8, 512, 2))
    found = estimate_response(u, y)
    np.testing.assert_allclose(np.sqrt(found.variances), 0.1, rtol=0.1)


def test_only_the_lines_that_periodic_inputs_excite_are_used():
    u = np.tile(np.random.default_rng(5).standard_normal((300, 2)), (4, 1))
    y = simulate(u)[600:]
    found = estimate_response(u[600:].reshape(1, -1, 2), y.reshape(1, -1, 2))
    assert found.lines == 149
    numbers = found.frequencies * 300 / (2 * np.pi)
    np.testing.assert_allclose(numbers, numbers.round(), rtol=1e-9)


@pytest.mark.parametrize("u", [np.zeros((1, 400, 2)), np.ones((1, 12, 2))], ids=["constant", "short"])
def test_inputs_that_show_no_response_give_none(u):
    assert estimate_response(u, u) is None
