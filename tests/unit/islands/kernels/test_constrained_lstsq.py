"""Least squares from inner products by each of three routes, which refuse a result without digits.

The error grows as the smallest squared pivot decreases: see `ERROR`. Seven digits are left well away from the
thresholds, three at worst.

The oracle is `constrained_least_squares`, an orthogonal factorisation of the columns.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.kernels import parameter_reduction
from islands.kernels.constrained_lstsq import (
    ILL_CONDITIONED,
    SINGULAR,
    ConstrainedFactor,
    correct,
    from_columns,
    from_gram,
)
from islands.kernels.parameter_reduction import expand
from islands.models.regressor import regressor
from islands.program.regressor_matrix import arrange_rows, gram_matrix, regressor_matrix, select_rows
from islands.program.term_pool import link
from islands.records.dataset import Dataset
from islands.simulation.outcome import OK

# The kernels are compiled with the types of these tests; the evaluation of structures tests them as well.
pytestmark = pytest.mark.ci

seeds = st.integers(0, 2**32 - 1)

#: Required sums of the groups.
WANTED = (1.0, 0.0, -0.5)


def gram_of(psi, y):
    """Return all inner products of the regressors and, last, the target."""
    rows = np.vstack([psi, y])
    return rows @ rows.T


def regression(terms=3, rows=200, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    psi = rng.normal(size=(terms, rows))
    return psi, rng.normal(size=terms) @ psi + noise * rng.normal(size=rows)


def sums(group, weight):
    """Return the groups as ``S theta = c``."""
    names = sorted(set(group) - {-1})
    S = [[w if g == name else 0.0 for g, w in zip(group, weight, strict=True)] for name in names]
    return np.array(S).reshape(len(names), len(group)), np.array([WANTED[name] for name in names])


def reduced(gram, group=None, weight=None):
    """Return the reduction; without groups every term is free."""
    terms = len(gram) - 1
    group = np.full(terms, -1) if group is None else np.array(group)
    weight = np.ones(terms) if weight is None else np.array(weight)
    wanted = np.array([WANTED[name] if name >= 0 else 0.0 for name in group])
    return parameter_reduction.reduce(gram, terms, group, weight, wanted)


#: Smallest relative squared pivot for which each route is trusted.
LEAST = {"gram": ILL_CONDITIONED, "corrected": SINGULAR, "columns": SINGULAR}


def solved(route, gram, program, rows, reduction):
    """Return theta from the Gram matrix, with a correction, or from the columns; None if it is refused."""
    terms, count = len(gram) - 1, reduction.free.size
    factor, eta = (
        ConstrainedFactor(np.full((count, count), np.nan), np.full(count, np.nan)),
        np.full(count, np.nan),
    )
    if route == "columns":
        least = from_columns(program, rows, terms, reduction, factor, eta)
    else:
        least = from_gram(gram, terms, reduction, factor, eta)
    if least < LEAST[route]:
        return None
    if route != "gram":
        correct(program, rows, terms, reduction, factor, eta)
    theta = np.full(terms, np.nan)
    expand(reduction, eta, theta)
    return theta


def columns_as_record(psi, y):
    """Return the program and the rows of a record whose inputs, one sample back, are the columns."""
    terms = len(psi)
    signals = np.vstack([np.append(0.0, y), np.append(psi, np.zeros((terms, 1)), axis=1)])
    program = link([*(Lagged(index + 1, 1) for index in range(terms)), Lagged(0, 0)])
    return program, arrange_rows(signals, [(1, len(y))], 1)


def estimated(route, psi, y, group=None, weight=None):
    gram = gram_of(psi, y)
    return solved(route, gram, *columns_as_record(psi, y), reduced(gram, group, weight))


every_route = pytest.mark.parametrize("route", LEAST)


@every_route
@given(
    st.integers(1, 6),
    st.lists(st.integers(-1, 2), min_size=6, max_size=6),
    seeds,
    st.lists(st.floats(-6, 6), min_size=6, max_size=6),
)
def test_estimate_equals_constrained_least_squares_if_well_conditioned(route, terms, group, seed, orders):
    """The sizes of the regressors differ by up to twelve orders of magnitude."""
    rng = np.random.default_rng(seed)
    psi, y = regression(terms, seed=seed)
    psi = psi * 10.0 ** np.array(orders[:terms])[:, None]
    size = np.abs(psi).max(axis=1)
    weight = rng.choice([-1.0, 1.0], terms) * rng.uniform(0.5, 2.0, terms) * size
    found = estimated(route, psi, y, group[:terms], weight)
    expected = constrained_least_squares(psi, y, *sums(group[:terms], weight))
    assert expected.outcome
    assert found is not None
    assert np.abs((found - expected.theta) * size).max() < 1e-9 * np.abs(expected.theta * size).max() + 1e-12


@every_route
def test_constraints_hold_up_to_rounding(route):
    psi, y = regression(5)
    group, weight = [0, 1, -1, 1, 0], [1.0, 2.0, 1.0, -1.0, 0.5]
    S, c = sums(group, weight)
    assert S @ estimated(route, psi, y, group, weight) == pytest.approx(c, abs=1e-14)
    assert np.abs(S @ estimated(route, psi, y) - c).max() > 0.1


@every_route
def test_estimate_ignores_the_data_if_every_term_is_a_pivot(route):
    psi, y = regression(3)
    assert estimated(route, psi, y, [2, 0, 1], [0.5, 4.0, 1.0]).tolist() == [-1.0, 0.25, 0.0]


# The pivots.


# Where the digits end.


@every_route
@pytest.mark.parametrize("value", [1e200, np.inf, np.nan])
@pytest.mark.parametrize("group", [None, [0, -1, 0], [0, 0, 0]])
def test_overflowing_regressor_is_refused(route, value, group):
    psi, y = regression()
    psi[1, 50] = value
    with np.errstate(all="ignore"):
        assert estimated(route, psi, y, group) is None


def nearly_dependent(distance, seed=1):
    """Return three regressors of norm one; the first and last differ by a squared norm of ``distance``."""
    rng = np.random.default_rng(seed)
    one, other, third = np.linalg.qr(rng.normal(size=(300, 3)))[0].T
    psi = np.array([one, third, np.sqrt(1 - distance) * one + np.sqrt(distance) * other])
    return psi, psi.sum(axis=0) + 1e-3 * rng.normal(size=300)


#: Bounds of the relative error of a trusted result: a factor and the power of ``eps / distance``. A
#: correction squares the error of the Gram matrix. The data, and so the error, depend on the processor: over
#: 60 seeds on two processors the largest errors were a quarter of these bounds.
ERROR = {"gram": (100.0, 1), "corrected": (1000.0, 2), "columns": (1e-4, 0)}


@pytest.mark.parametrize("distance", [1e-6, 1e-9, 1.2e-10, 1e-11, 1e-12, 3e-13, 1.5e-13])
@pytest.mark.parametrize("group", [None, [0, 1, 0]])
@every_route
def test_trusted_result_has_its_digits(distance, group, route):
    """A group leaves only the difference of the two regressors, which is well-conditioned by itself."""
    for seed in range(5):
        psi, y = nearly_dependent(distance, seed)
        found = estimated(route, psi, y, group)
        assert (found is not None) == (route != "gram" or distance > ILL_CONDITIONED)
        if found is not None:
            expected = constrained_least_squares(psi, y, *sums(group or [-1] * 3, np.ones(3))).theta
            factor, power = ERROR[route]
            bound = factor * (np.finfo(float).eps / distance) ** power + 1e-7
            assert found == pytest.approx(expected, rel=bound, abs=1e-12)


@pytest.mark.parametrize(("distance", "group"), [(1e-15, None), (0.0, None), (0.0, [0, 1, 0])])
@every_route
def test_result_without_digits_is_refused(distance, group, route):
    psi, y = nearly_dependent(distance)
    assert estimated(route, psi, y, group) is None


@pytest.mark.parametrize("distance", [1e-6, 1e-12, 1e-15, 1e-18])
def test_columns_are_reduced_before_they_are_squared(distance):
    """The error of the difference relative to itself is the rounding of the columns."""
    psi, y = nearly_dependent(distance)
    difference, rest = psi[2] - psi[0], y - psi[0]
    eta = (difference @ rest) / (difference @ difference)
    found = estimated("columns", psi, y, [0, 1, 0])
    assert found == pytest.approx([1.0 - eta, 0.0, eta], rel=1e-9)
    assert (estimated("corrected", psi, y, [0, 1, 0]) is None) == (distance < SINGULAR)


#: A slow input: neighbouring lags differ little, and their differences even less.
LAGS = ["y(k-1)", "y(k-2)", "y(k-3)", "u(k-1)", "u(k-2)", "u(k-3)"]


def slow(frequency, segments):
    k = np.arange(4000)
    u = np.sin(frequency * k) + 0.3 * np.sin(0.37 * frequency * k + 1)
    y = np.zeros(4000)
    for at in range(3, 4000):
        y[at] = 0.9 * y[at - 1] + 0.05 * u[at - 1] + 0.02 * u[at - 2]
    return Dataset(u, y + 1e-4 * np.random.default_rng(3).normal(size=4000), 0.01, segments=segments)


@pytest.mark.parametrize("segments", [(4000,), (1500, 900, 3, 1597)])
@pytest.mark.parametrize(
    ("texts", "group"),
    [
        (["y(k-1)", "u(k-1)", "u(k-2)", "u(k-3)"], None),
        (LAGS, None),
        (LAGS, [0, 0, 0, 1, 1, 1]),
        (["y(k-1)", "u(k-1)", "u(k-2)", "u(k-3)"], [0, 1, 1, 1]),
    ],
)
def test_columns_keep_six_digits_for_lags_of_a_slow_input(texts, group, segments):
    record, count = slow(0.003, segments), len(texts)
    terms = [*(regressor(parse(text))[1] for text in texts), Lagged(0, 0)]
    gram, program, rows = gram_matrix(terms, record, 3), link(terms), select_rows(record, 3)
    reduction = reduced(gram, group)
    psi = regressor_matrix(terms, record, 3)
    expected = constrained_least_squares(psi[:-1], psi[-1], *sums(group or [-1] * count, np.ones(count)))
    assert expected.outcome == OK
    assert solved("gram", gram, program, rows, reduction) is None
    for route in ("corrected", "columns"):
        theta = solved(route, gram, program, rows, reduction)
        assert np.abs(theta - expected.theta).max() < 1e-6 * np.abs(expected.theta).max()


@pytest.mark.parametrize("route", ["corrected", "columns"])
def test_lags_of_a_nearly_constant_input_are_refused(route):
    record = slow(0.001, (4000,))
    terms = [*(regressor(parse(text))[1] for text in LAGS), Lagged(0, 0)]
    gram, program, rows = gram_matrix(terms, record, 3), link(terms), select_rows(record, 3)
    assert solved(route, gram, program, rows, reduced(gram)) is None
    # With fixed sums, the remaining directions have digits again.
    assert solved(route, gram, program, rows, reduced(gram, [0, 0, 0, 1, 1, 1])) is not None
