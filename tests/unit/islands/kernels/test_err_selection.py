"""Selection and pruning by error reduction ratio; the oracle is Gram-Schmidt in extended precision.

The tests of `froe` check properties of the selection; this file checks the contract of the kernels.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.kernels.err_selection import DEPENDENT, prune, prune_increments, select
from islands.kernels.parameter_reduction import reduce


def problem(seed, terms=6, rows=150):
    """Draw correlated columns (terms, rows) and a target."""
    generator = np.random.default_rng(seed)
    psi = generator.normal(size=(terms, terms)) @ generator.normal(size=(terms, rows))
    return psi, generator.normal(size=terms) @ psi + 3.0 * generator.normal(size=rows)


def gram_of(psi, y, spare=0):
    """Return all inner products of the columns and, last, the target, in a larger matrix."""
    rows = np.vstack([psi, y])
    gram = np.full((len(rows) + spare,) * 2, np.nan)
    gram[: len(rows), : len(rows)] = rows @ rows.T
    return gram


def gram_schmidt(psi, y):
    """Select forward on the columns in extended precision; stop if no independent column is left."""
    left = dict(enumerate(psi.astype(np.longdouble)))
    norms = {position: column @ column for position, column in left.items()}
    target, chosen = y.astype(np.longdouble), []
    while left:
        err = {
            position: float((column @ target) ** 2 / (column @ column) / (target @ target))
            for position, column in left.items()
            if column @ column > DEPENDENT * norms[position]
        }
        if not err:
            break
        best = max(err, key=err.get)
        chosen.append((best, err[best]))
        pivot = left.pop(best)
        for position, column in left.items():
            left[position] = column - (pivot @ column) / (pivot @ pivot) * pivot
    return chosen


def selected(gram, candidates, tolerance=0.0, limit=None):
    limit = candidates if limit is None else limit
    order, err = np.full(limit, -7), np.full(limit, -7.0)
    count = select(gram, candidates, tolerance, limit, order, err)
    assert (order[count:] == -7).all()
    assert (err[count:] == -7.0).all()
    return list(zip(order[:count].tolist(), err[:count].tolist(), strict=True))


def pruned(gram, terms, tolerance):
    kept = np.full(terms, -7)
    count = prune(gram, terms, tolerance, kept)
    assert (kept[count:] == -7).all()
    return kept[:count].tolist()


def same(found, expected):
    assert [position for position, _ in found] == [position for position, _ in expected]
    assert [err for _, err in found] == pytest.approx([err for _, err in expected], rel=1e-8, abs=1e-13)


@given(
    st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(0, 3), st.floats(0.0, 0.3), st.integers(0, 9)
)
def test_selection_equals_gram_schmidt_on_the_columns(seed, terms, spare, tolerance, limit):
    psi, y = problem(seed, terms)
    expected = gram_schmidt(psi, y)
    end = next((rank for rank, (_, err) in enumerate(expected) if err <= tolerance), terms)
    limit = min(limit, terms)
    same(selected(gram_of(psi, y, spare), terms, tolerance, limit), expected[: min(end, limit)])


@pytest.mark.ci  # compiles the kernel, which only others call
@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(0, 3), st.floats(0.0, 0.3))
def test_pruning_keeps_the_terms_of_gram_schmidt_in_their_order(seed, terms, spare, tolerance):
    psi, y = problem(seed, terms)
    expected = sorted(position for position, err in gram_schmidt(psi, y) if err > tolerance)
    assert pruned(gram_of(psi, y, spare), terms, tolerance) == expected


@pytest.mark.parametrize("choose", [selected, pytest.param(pruned, marks=pytest.mark.ci)])
@pytest.mark.parametrize(("share", "count"), [(3e-5, 2), (3e-6, 1), (0.0, 1)])
def test_dependent_candidate_is_not_selected(choose, share, count):
    """A candidate must keep 1e-5 of its norm, 1e-10 of its squared norm."""
    one, other, noise = np.linalg.qr(np.random.default_rng(1).normal(size=(200, 3)))[0].T
    psi = np.array([one, one + share * other])
    gram = gram_of(psi, one + 0.1 * other + 0.5 * noise)
    assert len(choose(gram, 2, 0.0)) == count


def null_space_columns(psi, y, group, sums, previous):
    """Return free positions, their columns and the target without the part that the constraints fix."""
    terms = len(psi)
    pivots = {}
    for position in range(terms):
        if group[position] >= 0:
            members = [other for other in range(terms) if group[other] == group[position]]
            pivots[position] = min(members, key=lambda each: np.linalg.norm(psi[each]))
    target = y.copy()
    for pivot in set(pivots.values()):
        target -= sums[pivot] * psi[pivot]
    if not pivots and previous >= 0:
        target -= psi[previous]
    free = [position for position in range(terms) if pivots.get(position) != position]
    columns = [psi[each] - (psi[pivots[each]] if each in pivots else 0.0) for each in free]
    return free, np.array(columns), target, pivots


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("constrained", [False, True])
def test_pruning_of_increments_equals_gram_schmidt_in_the_null_space(seed, constrained):
    psi, y = problem(seed)
    group = np.array([0, 0, -1, 1, 1, -1]) if constrained else np.full(6, -1)
    sums = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    gram = gram_of(psi, y)
    reduction = reduce(gram, 6, group, np.ones(6), sums)
    free, columns, target, pivots = null_space_columns(psi, y, group, sums, 2)
    err = {free[position]: ratio for position, ratio in gram_schmidt(columns, target)}
    tolerance = float(np.median(list(err.values())))
    expected = {position for position, ratio in err.items() if ratio > tolerance}
    expected |= {pivots[position] for position in expected if position in pivots}
    expected |= {pivots[0]} if constrained else {2}
    kept = np.full(6, -7)
    count = prune_increments(gram, 6, reduction, 2, tolerance, kept)
    assert kept[:count].tolist() == sorted(expected)


@pytest.mark.parametrize("seed", range(5))
def test_rounding_selects_no_candidate(seed):
    """Scaled columns have other roundings: neither a target that is explained nor a remainder decides.

    Two of the first four candidates, which depend on each other nearly, explain the target.
    """
    generator = np.random.default_rng(seed)
    base = generator.normal(size=(6, 40))
    near = base[0] + 1e-4 * np.outer(range(4), base[1])
    psi = np.vstack([near, generator.normal(size=(12, 4)) @ base[2:]])
    target = 100.0 * base[0] + base[1]
    scales = 10.0 ** generator.integers(-9, 10, len(psi)) / 3.0
    orders = []
    for factors in (np.ones(len(psi)), scales):
        order, err = np.full(6, -1), np.empty(6)
        select(gram_of(psi * factors[:, None], target), len(psi), 0.0, 6, order, err)
        orders.append(order.tolist())
    assert orders[0] == orders[1]
