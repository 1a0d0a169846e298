"""Damped step of shared and own parameters: that of the complete linear equations."""

import numpy as np
import pytest

from islands.kernels.damped_step import solve_damped, solve_own

# The kernels are compiled at their first use.
pytestmark = pytest.mark.ci

SEGMENTS, DAMPING = 3, 1e-2


def make_products(shared, own, rows=400):
    """Return inner products of random columns, the last of which is the error."""
    columns = np.random.default_rng(shared + own).standard_normal((SEGMENTS, shared + own + 1, rows))
    return columns @ columns.transpose(0, 2, 1)


def solve(products, shared, own):
    """Return whether there is a step, and the step of the shared and of the own parameters."""
    squares = np.diagonal(products, axis1=1, axis2=2)
    scale, own_scale = np.sqrt(squares[:, :shared].sum(axis=0)), np.sqrt(squares[:, shared:-1])
    total = np.delete(products[:, :shared].sum(axis=0), range(shared, shared + own), axis=1)
    own_rows = products[:, shared:-1].copy()
    blocks, step = np.empty((SEGMENTS, own, own)), np.empty(shared)
    factors, changes = np.empty((SEGMENTS * own + shared, shared + 1)), np.empty((SEGMENTS, own))
    found = solve_damped(own_rows, total, scale, own_scale, DAMPING, blocks, factors, step)
    if found:
        solve_own(blocks, factors, step, changes)
    return found, step / scale, changes


@pytest.mark.parametrize("shared", [0, 1, 7, 31, 32, 70])
@pytest.mark.parametrize("own", [1, 6])
def test_the_step_solves_the_complete_equations(shared, own):
    products = make_products(shared, own)
    size = shared + SEGMENTS * own
    equations, right = np.zeros((size, size)), np.zeros(size)
    for segment, each in enumerate(products):
        places = [*range(shared), *range(shared + segment * own, shared + segment * own + own)]
        equations[np.ix_(places, places)] += each[:-1, :-1]
        right[places] += each[:-1, -1]
    equations[np.diag_indices(size)] *= 1.0 + DAMPING
    expected = np.linalg.solve(equations, right)
    found, step, changes = solve(products, shared, own)
    assert found
    assert np.append(step, changes) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("column", [0, 5])
def test_equations_that_are_not_positive_definite_have_no_step(column):
    products = make_products(4, 2)
    products[:, column, column] *= -1.0
    with np.errstate(invalid="ignore"):
        assert not solve(products, 4, 2)[0]
