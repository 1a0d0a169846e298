"""Least squares from inner products alone: as good as from the columns, or a word that it is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.estimation.constrained import constrained_least_squares
from islands.estimation.normal_equations import ILL_CONDITIONED, from_gram
from islands.simulation.outcome import Outcome, Verdict

NONE = np.empty((0, 3)), np.empty(0)


def gram_of(psi, y):
    """All inner products of the regressors and, last, the target."""
    rows = np.vstack([psi, y])
    return rows @ rows.T


def regression(terms=3, rows=200, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    psi = rng.normal(size=(terms, rows))
    return psi, rng.normal(size=terms) @ psi + noise * rng.normal(size=rows)


@given(
    st.integers(1, 6),
    st.integers(0, 3),
    st.integers(0, 2**32 - 1),
    st.lists(st.floats(-6, 6), min_size=6, max_size=6),
)
def test_it_equals_constrained_least_squares_on_well_conditioned_data(terms, constraints, seed, orders):
    """Whatever the regressors' sizes: twelve orders of magnitude lie between them."""
    constraints = min(constraints, terms)
    rng = np.random.default_rng(seed)
    psi, y = regression(terms, seed=seed)
    psi = psi * 10.0 ** np.array(orders[:terms])[:, None]
    size = np.abs(psi).max(axis=1)
    S, c = rng.normal(size=(constraints, terms)) * size, rng.normal(size=constraints)
    expected = constrained_least_squares(psi, y, S, c)
    found = from_gram(gram_of(psi, y), S, c)
    assert expected.outcome
    assert isinstance(found, np.ndarray)
    assert np.abs((found - expected.theta) * size).max() < 1e-8 * np.abs(expected.theta * size).max()


def test_the_constraints_hold_to_rounding():
    psi, y = regression(4)
    S, c = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 2.0, -1.0]]), np.array([1.0, 0.5])
    theta = from_gram(gram_of(psi, y), S, c)
    assert S @ theta == pytest.approx(c, abs=1e-12)
    free = from_gram(gram_of(psi, y), np.empty((0, 4)), np.empty(0))
    assert np.abs(S @ free - c).max() > 0.1


def test_as_many_constraints_as_terms_leave_nothing_to_the_data():
    psi, y = regression(2)
    theta = from_gram(gram_of(psi, y), np.array([[1.0, 1.0], [1.0, -1.0]]), np.array([1.0, 0.0]))
    assert theta == pytest.approx([0.5, 0.5], abs=1e-12)


@pytest.mark.parametrize(
    ("S", "c", "reason"),
    [
        ([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]], [1.0, 2.0], "is a combination of the others"),
        ([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]], [1.0, 5.0], "contradicts the others"),
        ([[0.0, 0.0, 0.0]], [1.0], "constraint 1 names no regressor"),
    ],
)
def test_constraints_that_cannot_be_met_are_an_outcome(S, c, reason):
    found = from_gram(gram_of(*regression()), np.array(S), np.array(c))
    assert isinstance(found, Outcome)
    assert found.verdict is Verdict.INFEASIBLE
    assert reason in found.reason


@pytest.mark.parametrize("value", [0.0, np.inf, np.nan])
def test_a_regressor_that_is_zero_or_overflows_is_left_to_the_columns(value):
    gram = gram_of(*regression())
    gram[1, :] = gram[:, 1] = value
    assert from_gram(gram, *NONE) is None


def nearly_dependent(distance):
    """Two regressors of norm one whose difference has a squared norm of about ``2 distance``."""
    rng = np.random.default_rng(1)
    one, other, third = np.linalg.qr(rng.normal(size=(300, 3)))[0].T
    psi = np.array([one, third, np.sqrt(1 - distance) * one + np.sqrt(distance) * other])
    return psi, psi.sum(axis=0) + 1e-3 * rng.normal(size=300)


@pytest.mark.parametrize(("distance", "trusted"), [(1e-6, True), (1e-9, True), (1e-11, False), (0.0, False)])
def test_it_knows_where_its_digits_end(distance, trusted):
    psi, y = nearly_dependent(distance)
    found = from_gram(gram_of(psi, y), *NONE)
    assert (found is not None) == trusted
    if trusted:
        expected = constrained_least_squares(psi, y, *NONE)
        # Rounding of 1e-16 beside a squared pivot: what is promised are six digits.
        assert found == pytest.approx(expected.theta, rel=1e-16 / distance * 100)
    assert ILL_CONDITIONED == 1e-10


@pytest.mark.parametrize(("distance", "trusted"), [(1e-6, True), (1e-9, True), (1e-11, False), (0.0, False)])
def test_a_constraint_that_leaves_a_small_difference_free_does_not_hide_it(distance, trusted):
    """One direction is left, the difference of the two: beside itself it is of full size, and all noise."""
    psi, y = nearly_dependent(distance)
    S, c = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), np.array([2.0, 1.0])
    found = from_gram(gram_of(psi, y), S, c)
    assert (found is not None) == trusted
    if trusted:
        expected = constrained_least_squares(psi, y, S, c)
        assert found == pytest.approx(expected.theta, rel=1e-16 / distance * 100)
