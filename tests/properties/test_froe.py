"""Properties of forward orthogonal regression by error reduction ratio, equation (6).

Oracle: a textbook forward selection by modified Gram-Schmidt on columns, in extended precision.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.estimation.least_squares import least_squares
from islands.estimation.structure_selection.froe import froe
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.models.regressor import regressor
from islands.program.regressor_matrix import gram_matrix
from islands.records.dataset import Dataset
from support.regressions import problem, seeds, squares


def inner_products(psi, y):
    stacked = np.vstack([psi, y])
    return stacked @ stacked.T


def textbook(psi, y):
    """Select forward by modified Gram-Schmidt on the columns, in extended precision."""
    left = dict(enumerate(psi.astype(np.longdouble)))
    norms = {position: column @ column for position, column in left.items()}
    target = y.astype(np.longdouble)
    order, ratios = [], []
    while left:
        err = {
            position: (column @ target) ** 2 / (column @ column) / (target @ target)
            for position, column in left.items()
            if column @ column > 1e-20 * norms[position]
        }
        if not err:
            break
        best = max(err, key=err.get)
        order.append(best)
        ratios.append(float(err[best]))
        chosen = left.pop(best)
        left = {
            position: column - (chosen @ column) / (chosen @ chosen) * chosen
            for position, column in left.items()
        }
    return order, ratios


@pytest.mark.parametrize("seed", range(50))
def test_froe_agrees_with_the_textbook_selection_on_columns(seed):
    psi, y = problem(seed, 8, 200, noise=3.0)
    found = froe(inner_products(psi, y))
    order, ratios = textbook(psi, y)
    assert list(found.order) == order
    np.testing.assert_allclose(found.err, ratios, rtol=1e-6, atol=1e-12)


@given(seeds, st.integers(1, 10))
def test_error_reduction_ratios_sum_to_the_explained_fraction(seed, terms):
    psi, y = problem(seed, terms, noise=1.0)
    found = froe(inner_products(psi, y))
    assert len(found.order) == terms
    assert min(found.err) > 0.0
    assert sum(found.err) <= 1.0 + 1e-12
    explained = 1.0 - squares(psi, y, least_squares(psi, y).theta) / (y @ y)
    assert sum(found.err) == pytest.approx(explained, abs=1e-9)


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_overflowed_candidate_is_not_selected_and_has_no_effect(value):
    psi, y = problem(16, 4)
    usual = froe(inner_products(np.delete(psi, 2, axis=0), y))
    gram = inner_products(psi, y)
    gram[2] = gram[:, 2] = value
    found = froe(gram)
    assert found.order == tuple(item + (item > 1) for item in usual.order)
    assert found.err == usual.err


# Units.

TEXTS = [
    "y(k-1)",
    "y(k-3)",
    "u(k-1)",
    "u(k-2)^2*y(k-1)",
    "sign(u(k-1) - u(k-2))",
    "(u(k-1) - u(k-2))*y(k-1)^2",
    "abs(u(k-3))*sign(y(k-1))",
]


def measured(volts=1.0, metres=1.0):
    generator = np.random.default_rng(18)
    u = generator.normal(size=400)
    y = np.zeros(400)
    for k in range(3, 400):
        y[k] = 0.6 * y[k - 1] - 0.1 * y[k - 3] + u[k - 1] + 0.1 * u[k - 2] ** 2 * np.tanh(y[k - 1])
        y[k] += 0.3 * np.sign(u[k - 1] - u[k - 2]) + 0.2 * generator.normal()
    return Dataset(volts * u, metres * y, 0.1)


@pytest.mark.parametrize(("volts", "metres"), [(1e3, 1.0), (1.0, 1e-6), (58.8, 4.7e-5), (1e-4, 1e5)])
def test_units_of_the_record_do_not_change_the_order(volts, metres):
    terms = [*(regressor(parse(text))[1] for text in TEXTS), Lagged(0, 0)]
    before, after = (froe(gram_matrix(terms, item, 3)) for item in (measured(), measured(volts, metres)))
    assert len(before.order) == len(TEXTS)
    assert after.order == before.order
    np.testing.assert_allclose(after.err, before.err, rtol=1e-6)
