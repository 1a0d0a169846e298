"""The evaluation of a population equals that of each individual, step by step on columns."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.estimation.structure_selection.froe import froe
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.kernels.err_selection import OUTPUT
from islands.kernels.pair_table import FREE, Pairs
from islands.kernels.population import (
    ABANDONED,
    DEPENDENT,
    DIVERGED,
    INFEASIBLE,
    NO_TERMS,
    OK,
    OVERFLOW,
    Groups,
    PopulationContext,
    SelectedTerms,
    empty_results,
    empty_terms,
    evaluate,
)
from islands.models.clusters import OUTPUT_AT_REST, clusters, steady_state
from islands.models.narx import Model
from islands.models.regressor import regressor
from islands.program.regressor_matrix import gram_matrix, regressor_matrix, select_rows
from islands.program.term_pool import TermPool
from islands.records.dataset import Dataset
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound, multiple_shooting

TOLERANCE, INTERVAL, WARM_UP = 1e-3, 20, 4
TEXTS = [
    "y(k-1)",
    "y(k-2)",
    "u(k-1)",
    "u(k-2)",
    "u(k-4)",
    "y(k-1)*u(k-1)",
    "y(k-2)*u(k-3)",
    "sign(u(k-1) - u(k-2))",
    "(u(k-1) - u(k-2))*abs(u(k-1) - u(k-2))",
    "tanh(y(k-1)*u(k-1))",
    "1",
    "y(k-3)^2",
]
TERMS = sorted((regressor(parse(text))[1] for text in TEXTS), key=lambda item: item.content)


def record(seed=0, segments=(400, 150)):
    rng = np.random.default_rng(seed)
    samples = sum(segments)
    u, y = rng.normal(size=samples), np.zeros(samples)
    for k in range(2, samples):
        y[k] = 0.5 * y[k - 1] + 0.2 * y[k - 2] + 0.4 * u[k - 1] - 0.2 * y[k - 1] * u[k - 1]
    return Dataset(u, y + 0.1 * rng.normal(size=samples), 0.1, segments=segments)


RECORD = record()

#: No equalities and no signs.
PLAIN = np.empty((len(TERMS) + 1, 0)), np.empty(0), np.empty(0), np.empty(0, np.int64)


def make_groups(terms, constrained):
    """Return the clusters of the target and the terms as groups; the cluster of y is the first."""
    group, weight = np.full(len(terms) + 1, -1), np.zeros(len(terms) + 1)
    if not constrained:
        return Groups(group, weight, np.empty(0), 0, *PLAIN)
    names = {OUTPUT_AT_REST: 0}
    for number, item in enumerate(terms, 1):
        size, state = steady_state(item)
        if size:
            group[number], weight[number] = names.setdefault(state, len(names)), size
    return Groups(group, weight, np.array([1.0, *[0.0] * (len(names) - 1)]), 1, *PLAIN)


def table(places=1 << 12):
    return Pairs(np.full(places, FREE), np.zeros(places), np.zeros(1, np.int64))


def evaluated(
    structures, pruned, data=RECORD, terms=TERMS, constrained=False, pairs=None, allowed=math.inf, before=()
):
    """Return kept positions, theta, error and status of every structure, a list of positions in ``terms``."""
    store = TermPool()
    store.terms([Lagged(0, 0), *terms])
    store.terms(before)
    most = max(map(len, structures))
    numbers = np.full((len(structures), most), -1)
    for row, structure in zip(numbers, structures, strict=True):
        row[: len(structure)] = np.array(structure, np.int64) + 1
    selected, results = empty_terms(len(structures), most), empty_results(len(structures), most)
    for array in (*selected, *results):
        array.fill(-7)
    context = PopulationContext(
        0,
        -1,
        OUTPUT,
        TOLERANCE,
        store.nodes,
        make_groups(terms, constrained),
        table() if pairs is None else pairs,
        select_rows(data, WARM_UP),
        layout(data, WARM_UP, INTERVAL),
        divergence_bound(data.y),
    )
    sizes = np.array([len(structure) for structure in structures])
    given, bounds = SelectedTerms(numbers, sizes), np.full(most + 1, allowed)
    evaluate(given, np.array(pruned), bounds, context, selected, results)
    return [
        (
            tuple(structure.index(term - 1) for term in kept[:length].tolist()),
            tuple(parameters[:length].tolist()),
            squares,
            end,
        )
        for structure, kept, length, parameters, squares, end in zip(
            structures,
            selected.terms,
            selected.lengths.tolist(),
            results.theta,
            results.error.tolist(),
            results.status.tolist(),
            strict=True,
        )
    ]


def step_by_step(structure, pruned, constrained):
    """Prune, constrain, estimate and simulate on columns; return kept positions, theta, status, error."""
    left = list(range(len(structure)))
    terms = [TERMS[position] for position in structure]
    if pruned:
        found = froe(gram_matrix([*terms, Lagged(0, 0)], RECORD, WARM_UP))
        left = sorted(item for item, err in zip(found.order, found.err, strict=True) if err > TOLERANCE)
    S, c = np.empty((0, len(left))), np.empty(0)
    if constrained:
        lone = {
            group.members[0]
            for group in clusters([terms[item] for item in left])
            if len(group.members) == 1 and group.steady_state != OUTPUT_AT_REST
        }
        left = [item for rank, item in enumerate(left) if rank not in lone]
        groups = clusters([terms[item] for item in left])
        S, c = np.zeros((len(groups), len(left))), np.zeros(len(groups))
        for row, group in enumerate(groups):
            S[row, group.members] = group.weights
            c[row] = group.steady_state == OUTPUT_AT_REST
        if left and not c.any():
            return tuple(left), None, INFEASIBLE
    if not left:
        return (), None, NO_TERMS
    kept = [terms[item] for item in left]
    psi = regressor_matrix([*kept, Lagged(0, 0)], RECORD, WARM_UP)
    theta = constrained_least_squares(psi[:-1], psi[-1], S, c).theta
    model = Model(tuple(kept), tuple(theta.tolist()), RECORD.input_names, RECORD.output_name, RECORD.dt)
    found = multiple_shooting(model, RECORD, INTERVAL, WARM_UP)
    squares = found.mean_squared_error * np.isfinite(found.y).sum()
    return tuple(left), theta, OK if found.outcome else DIVERGED, squares


positions = st.lists(st.integers(0, len(TERMS) - 1), min_size=1, max_size=6, unique=True).map(sorted)
population = st.lists(st.tuples(positions, st.booleans()), min_size=1, max_size=6)


@pytest.mark.parametrize("constrained", [False, True])
@given(drawn=population)
def test_evaluation_equals_its_separate_steps_on_columns(constrained, drawn):
    found = evaluated(*zip(*drawn, strict=True), constrained=constrained)
    for (structure, pruned), (kept, theta, error, status) in zip(drawn, found, strict=True):
        left, parameters, expected, *squares = step_by_step(structure, pruned, constrained)
        assert (kept, status) == (left, expected)
        if status == OK:
            np.testing.assert_allclose(theta, parameters, rtol=1e-8, atol=1e-10)
            assert error == pytest.approx(squares[0], rel=1e-8)
        else:
            assert error == math.inf


def same(left, right):
    """Return whether results are equal to the last bit; theta after a failure is ignored."""
    strip = [
        [(kept, theta if status == OK else (), error, status) for kept, theta, error, status in found]
        for found in (left, right)
    ]
    return strip[0] == strip[1]


@given(positions, st.booleans(), st.floats(0.0, 2.0))
def test_allowed_error_abandons_only_larger_errors(structure, pruned, share):
    (whole,) = evaluated([structure], [pruned])
    (_, _, error, status) = whole
    if status != OK:
        return
    (found,) = evaluated([structure], [pruned], allowed=share * error)
    if found[-1] == ABANDONED:
        assert share < 1.0
        assert found[2] == math.inf
    else:
        assert share > 1.0 - 1e-8
        assert same([found], [whole])


def get_status(texts, data=RECORD, constrained=False, pruned=False):
    terms = sorted((regressor(parse(text))[1] for text in texts), key=lambda item: item.content)
    ((*_, error, status),) = evaluated([range(len(terms))], [pruned], data, terms, constrained)
    assert (error == math.inf) == (status != OK)
    return status


@pytest.mark.parametrize(
    ("texts", "status"),
    [
        (["y(k-1)", "u(k-1)"], OK),
        (["u(k-1)", "u(k-2)", "u(k-1) + u(k-2)"], DEPENDENT),
        (["y(k-1)", "u(k-1)", "u(k-1) + 0.0000000001*u(k-2)"], DEPENDENT),
        (["y(k-1)", "y(k-2)", "exp(50 + u(k-1))^9"], OVERFLOW),
    ],
)
def test_status_of_a_structure_follows_from_its_columns(texts, status):
    assert get_status(texts) == status


def test_slow_record_is_estimated_to_six_digits():
    k = np.arange(4000)
    u = np.sin(0.003 * k) + 0.3 * np.sin(0.0011 * k + 1)
    y = np.convolve(u, [0.0, 0.05, 0.02, 0.01])[:4000] + 1e-4 * np.random.default_rng(3).normal(size=4000)
    data = Dataset(u, y, 0.01)
    terms = [regressor(parse(text))[1] for text in ("u(k-1)", "u(k-2)", "u(k-3)")]
    ((_, theta, error, status),) = evaluated([[0, 1, 2]], [False], data, terms)
    psi = regressor_matrix([*terms, Lagged(0, 0)], data, WARM_UP)
    expected = constrained_least_squares(psi[:-1], psi[-1], np.empty((0, 3)), np.empty(0)).theta
    assert status == OK
    np.testing.assert_allclose(theta, expected, rtol=1e-6)
    assert error == pytest.approx(float(np.sum((psi[-1] - expected @ psi[:-1]) ** 2)), rel=1e-9)
