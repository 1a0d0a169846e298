"""Gauss-Jordan elimination."""

import numpy as np
import pytest

from islands.estimation.constraints.elimination import eliminate


def solution(found, free, columns):
    """Return the parameters of given free ones."""
    theta = np.zeros(columns)
    others = [j for j in range(columns) if j not in found.pivots]
    theta[others] = free[: len(others)]
    for pivot, share, fixed in zip(found.pivots, found.share, found.fixed, strict=True):
        theta[pivot] = fixed - share[others] @ theta[others]
    return theta


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_every_choice_of_free_parameters_meets_the_rows(seed, first):
    generator = np.random.default_rng(seed)
    S = generator.normal(size=(3, 7)) * 10.0 ** generator.integers(-6, 6, size=7)
    c = generator.normal(size=3)
    found = eliminate(S, c, first)
    theta = solution(found, generator.normal(size=7), 7)
    np.testing.assert_allclose(S @ theta, c, rtol=0, atol=1e-9 * np.max(np.abs(S * theta)))


def test_contradiction_is_the_number_of_the_row():
    S = np.array([[1.0, 1.0, 0.0], [0.0, 0.1, 0.3], [1.0, 1.3, 0.9]])
    assert eliminate(S, np.array([1.0, 0.2, 1.61])) == 2
    assert eliminate(np.zeros((1, 3)), np.array([1.0])) == 0
