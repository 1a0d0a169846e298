"""Properties of forward selection over a library: nested, constrained and correct structures.

Forward selection is greedy and may miss a true term if the excitation is slow or rich. These tests use small
systems of the library under an excitation that separates their terms.
"""

from itertools import pairwise

import numpy as np
import pytest

import islands
from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.forward_selection import (
    MAX_POOL,
    find_simplest,
    forward_selection,
    make_selection_problem,
    select_pool,
)
from islands.expressions.printing import plain
from islands.models.candidate_library import candidates
from islands.records.dataset import Dataset, join
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.validation.physics import cluster_sums

LAGS = 3
SETTINGS = [
    ("polynomial", 2, "none"),
    ("polynomial", 2, "hysteresis"),
    ("phi-polynomial", 3, "none"),
    ("phi-polynomial", 3, "hysteresis"),
]


def library(name, degree, inputs=1):
    return candidates(name, degree, LAGS, inputs)


def texts(structure, inputs=1):
    return [plain(item.expression, inputs) for item in structure]


def walk(samples, seed, inputs=1):
    """Return a slow input that crosses all levels in both directions."""
    return 0.1 * np.cumsum(np.random.default_rng(seed).normal(size=(samples, inputs)), axis=0)


def white(samples, seed, inputs=1):
    return np.random.default_rng(seed).uniform(-1, 1, size=(samples, inputs))


def narx(u, noise, seed):
    """y(k) = 0.5 y(k-2) + u(k-1) + 0.4 u(k-1)^2 - 0.3 y(k-1) u(k-2) + e(k)."""
    e, u, y = noise * np.random.default_rng(seed + 1000).normal(size=len(u)), u[:, 0], np.zeros(len(u))
    for k in range(LAGS, len(u)):
        y[k] = 0.5 * y[k - 2] + u[k - 1] + 0.4 * u[k - 1] ** 2 - 0.3 * y[k - 1] * u[k - 2] + e[k]
    return y


NARX = {"y(k-2)": 0.5, "u(k-1)": 1.0, "u(k-1)^2": 0.4, "y(k-1)*u(k-2)": -0.3}


def hysteresis(u, noise, seed, start=0.0):
    """y(k) = y(k-1) + 0.8 du(k-1) - 0.3 y(k-1) |du(k-1)| + 0.2 u(k-1)^2 du(k-2) + e(k)."""
    e, u, y = noise * np.random.default_rng(seed + 1000).normal(size=len(u)), u[:, 0], np.full(len(u), start)
    for k in range(LAGS, len(u)):
        new, old = u[k - 1] - u[k - 2], u[k - 2] - u[k - 3]
        y[k] = y[k - 1] + 0.8 * new - 0.3 * y[k - 1] * abs(new) + 0.2 * u[k - 1] ** 2 * old + e[k]
    return y


HYSTERESIS = {
    "y(k-1)": 1.0,
    "u(k-1) - u(k-2)": 0.8,
    "y(k-1)*sign(u(k-1) - u(k-2))*(u(k-1) - u(k-2))": -0.3,
    "u(k-1)^2*(u(k-2) - u(k-3))": 0.2,
}


def measured(seed=0, samples=400):
    """Return a record that no structure of any library explains exactly."""
    u = walk(samples, seed)
    y = np.tanh(hysteresis(u, 0.02, seed)) + 0.3 * np.sin(3 * u[:, 0])
    return Dataset(u, y, 0.1)


# Nesting.


@pytest.mark.parametrize(("name", "degree", "constraints"), SETTINGS)
def test_structures_are_nested(name, degree, constraints):
    found = forward_selection(library(name, degree), measured(1), constraints, 10)
    for before, after in pairwise(found):
        assert set(before) < set(after)
        assert len(after) - len(before) <= (2 if constraints == "hysteresis" else 1)
        assert list(after) == [item for item in library(name, degree) if item in set(after)]


# Correctness.


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_sparse_system_of_the_library_is_found_exactly(seed, degree, noise):
    u = white(1000, seed)
    data = Dataset(u, narx(u, noise, seed), 0.1)
    found = forward_selection(library("polynomial", degree), data, "none", 4)
    assert sorted(texts(found[-1])) == sorted(NARX)
    model = estimate(found[-1], data).model
    for text, parameter, error in zip(texts(found[-1]), model.theta, model.standard_errors, strict=True):
        assert parameter == pytest.approx(NARX[text], abs=max(1e-9, 5 * error))
        assert error < 0.05


@pytest.mark.parametrize("constraints", ["none", "hysteresis"])
@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("seed", range(4))
def test_sparse_hysteresis_of_the_library_is_found_exactly(seed, noise, constraints):
    u = walk(1000, seed)
    data = Dataset(u, hysteresis(u, noise, seed), 0.1)
    found = forward_selection(library("phi-polynomial", 3), data, constraints, 4)
    assert sorted(texts(found[-1])) == sorted(HYSTERESIS)
    model = estimate(found[-1], data, constraints).model
    for text, parameter, error in zip(texts(found[-1]), model.theta, model.standard_errors, strict=True):
        assert parameter == pytest.approx(HYSTERESIS[text], abs=max(1e-9, 5 * error))
    if constraints == "hysteresis":
        assert model.theta[0] == pytest.approx(1.0, abs=1e-15)


# Constraints.


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("name", "degree"), [("polynomial", 2), ("phi-polynomial", 3)])
def test_structures_selected_under_the_constraint_meet_it(name, degree, seed):
    data = measured(seed)
    found = forward_selection(library(name, degree), data, "hysteresis", 12)
    assert len(found) >= 4
    for structure in found:
        estimated = estimate(structure, data, "hysteresis", LAGS)
        assert isinstance(estimated, FittedStructure)
        # Estimation keeps all selected regressors.
        assert estimated.model.regressors == structure
        sums = {entry.cluster: entry.sum for entry in cluster_sums(estimated.model)}
        assert sums.pop("y") == pytest.approx(1.0, abs=1e-9)
        assert all(total == pytest.approx(0.0, abs=1e-9) for total in sums.values())


def test_constrained_selection_is_better_than_repaired_free_selection():
    # The constraint removes some of the freely selected terms.
    data = measured(1)
    free, bound = (
        forward_selection(library("polynomial", 2), data, name, 8) for name in ("none", "hysteresis")
    )
    repaired = [estimate(structure, data, "hysteresis", LAGS) for structure in free]
    assert [entry.model.size for entry in repaired] == [1, 2, 3, 3, 5, 6, 6, 8]
    for size in range(3, 9):
        structure = max((item for item in bound if len(item) <= size), key=len)
        chosen = estimate(structure, data, "hysteresis", LAGS)
        assert chosen.residual_variance < 0.8 * repaired[size - 1].residual_variance


def test_library_that_cannot_meet_the_constraint_is_infeasible():
    without = [item for item in library("phi-polynomial", 2) if plain(item.expression) != "y(k-1)"]
    found = forward_selection(without, measured(), "hysteresis")
    assert isinstance(found, EvaluationOutcome)
    assert found.verdict is Status.INFEASIBLE
    assert found.reason == "no regressor is y at rest: add y(k-1)"


# Segments.


@pytest.mark.parametrize(("name", "degree", "constraints"), SETTINGS)
def test_recordings_that_overlap_by_the_maximum_lag_equal_one_record(name, degree, constraints):
    # With the overlap, every row of the record occurs once; without it, rows across the cut are missing.
    data = measured(3)
    cut = join((data[:170], data[170 - LAGS :]))
    whole = forward_selection(library(name, degree), data, constraints, 8)
    assert forward_selection(library(name, degree), cut, constraints, 8) == whole
    turned = join((data[170 - LAGS :], data[:170]))
    assert forward_selection(library(name, degree), turned, constraints, 8) == whole


# From a structure to a model.


def test_order_and_repetition_of_regressors_have_no_effect():
    terms = library("polynomial", 1)
    assert estimate((*reversed(terms), terms[0]), measured()) == estimate(terms, measured())


@pytest.mark.parametrize(
    ("samples", "constraints", "verdict"),
    [(10, "none", Status.TOO_FEW_ROWS), (400, "none", Status.SINGULAR), (400, "hysteresis", Status.OK)],
)
def test_estimation_failure_is_an_outcome_with_a_reason(samples, constraints, verdict):
    # u(k-1), u(k-2) and their difference depend on each other; the constraint drops the lone u(k-1)*y(k-1).
    names = ["y(k-1)", "u(k-1) - u(k-2)", "u(k-1)", "u(k-2)", "1", "u(k-3)", "u(k-3)^2", "y(k-1)*u(k-1)"]
    if verdict is Status.OK:
        names = ["y(k-1)", "u(k-1) - u(k-2)", "y(k-1)*u(k-1)"]
    terms = islands.make_model([(islands.parse(text), 1.0) for text in names]).regressors
    found = estimate(terms, measured(samples=samples), constraints)
    if verdict is Status.OK:
        assert texts(found.model.regressors) == ["y(k-1)", "u(k-1) - u(k-2)"]
    else:
        assert found.verdict is verdict
        assert found.reason


def test_the_candidates_of_a_search_do_not_follow_rounding():
    """Forward selection explains 80 rows with 77 terms; the order of the last ones is that of rounding."""
    u, rng = white(80, 0, 3), np.random.default_rng(1)
    y = np.convolve(u.sum(axis=1) + u[:, 0] * u[:, 1], [0.5, 0.3, 0.2])[:80] + 0.01 * rng.normal(size=80)
    terms = library("polynomial", 3, inputs=3)

    def select(record):
        return select_pool(terms, make_selection_problem(terms, record), 10)

    pool = select(Dataset(u, y, 0.1))
    assert len(pool) == MAX_POOL < len(terms)
    assert select(Dataset(np.round(u, 7), np.round(y, 7), 0.1)) == pool
    assert select(Dataset(1e9 * u, 1e-6 * y, 0.1)) == pool


def test_of_equal_columns_the_simplest_is_a_term():
    """The sign of a positive output is a constant: rounding must not choose between them."""
    u = white(200, 0)
    record = Dataset(u, 5.0 + narx(u, 0.01, 0), 0.1)
    found = find_simplest(make_selection_problem(candidates("friction", 2, LAGS, 1), record))
    pairs = {one.text: other.text for one, other in found.items() if one != other}
    assert pairs["sign(y(k-1))"] == "1"
    assert pairs["y(k-2)*sign(y(k-1))"] == "y(k-2)"
    assert all("sign(y(k-1))" in text for text in pairs)
