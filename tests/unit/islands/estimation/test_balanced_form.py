"""Balanced form: equal and diagonal Gramians."""

import numpy as np
import pytest
import scipy

from islands.estimation.balanced_form import find_balanced_form


def test_inputs_reach_a_state_as_much_as_the_output_shows_it():
    # Modes that almost cancel each other.
    a, b, c = np.diag([0.95, 0.94, 0.3]), np.array([[1.0], [1.0], [0.2]]), np.array([10.0, -10.0, 1.0])
    forward = find_balanced_form(a, b, c)
    a, b, c = np.linalg.solve(forward, a @ forward), np.linalg.solve(forward, b), c @ forward
    reached = scipy.linalg.solve_discrete_lyapunov(a, b @ b.T)
    shown = scipy.linalg.solve_discrete_lyapunov(a.T, np.outer(c, c))
    assert reached == pytest.approx(shown, abs=1e-9 * reached.max())
    assert reached == pytest.approx(np.diag(np.diag(reached)), abs=1e-9 * reached.max())


def test_states_that_no_input_reaches_remain():
    assert np.array_equal(find_balanced_form(np.eye(2) / 2.0, np.zeros((2, 1)), np.ones(2)), np.eye(2))
