"""Minimum of the error of a linear difference equation with its initial states."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear_simulation import LinearProblem, find_start, minimise, project, solve
from islands.expressions.tree import Lagged

A, B = np.array([-1.5, 0.7]), [0.1, 0.15]


def make_problem(lengths, seed=0):
    """Return the rows of a second-order system without noise, from other states in every segment."""
    random = np.random.default_rng(seed)
    columns, y = [], []
    for samples in lengths:
        u = random.normal(size=samples + 50)
        columns.append(np.array([u[49:-1], u[48:-2]]))
        y.append(lfilter([0.0, *B], np.append(1.0, A), u)[50:])
    terms = tuple(Lagged(channel, lag) for channel in (0, 1) for lag in (1, 2))
    return LinearProblem(2, terms, np.hstack(columns), np.concatenate(y), np.cumsum(lengths))


def test_steps_from_the_start_find_the_exact_equation():
    found = minimise(find_start(make_problem((80, 60, 90))), 1e-7)
    assert found.denominator == pytest.approx(A, abs=1e-9)


def test_whether_columns_depend_on_each_other_is_decided_once():
    """In another order of the columns, the initial state depends on them: the solution keeps its rank."""
    random = np.random.default_rng(2)
    other, rest = random.standard_normal((2, 90))
    pulse = np.eye(1, 90)[0]
    columns = np.vstack([pulse - 1e-3 * other - 1e-12 * rest, other])
    problem = replace(make_problem((90,)), columns=columns)
    divided = problem.divide(A, columns)
    assert project(np.roll(divided, -problem.states, axis=0), problem.y) is None
    found = solve(problem, A)
    simulated = found.coefficients @ problem.divide(A, columns)
    assert simulated == pytest.approx(problem.y - found.residual, abs=1e-4 * np.abs(problem.y).max())
