"""Certificates of a model size: bounds that no model of the library undercuts, and the best subsets.

Oracle: least squares on every subset.
"""

from itertools import combinations
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import islands
from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.forward_selection import make_selection_problem, select_forward
from islands.estimation.structure_selection.certificate import SubsetSearch, combine_certificates
from islands.expressions.tree import Lagged
from islands.models.candidate_library import candidates
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.text.summary import method_text
from islands.simulation.predictors import multiple_shooting

LAGS = 2


def measured(seed=0, samples=200):
    """Return a record with correlated lags that no structure of a library explains exactly."""
    generator = np.random.default_rng(seed)
    u = np.convolve(generator.normal(size=samples), np.ones(5) / 2.0, mode="same")
    y = np.zeros(samples)
    for k in range(LAGS, samples):
        y[k] = (
            0.6 * y[k - 1] + 0.3 * np.tanh(u[k - 1]) - 0.2 * y[k - 1] * u[k - 2] + 0.05 * generator.normal()
        )
    return Dataset(u, y, 0.1)


def root_mean_square(structure, record, constraints):
    """Return the one-step-ahead error of a structure; infinite if it cannot be estimated."""
    if constraints == "none":
        *psi, y = regressor_matrix([*structure, Lagged(0, 0)], record, LAGS)
        theta = np.linalg.lstsq(np.array(psi).T, y, rcond=None)[0]
        return float(np.sqrt(np.mean((y - theta @ np.array(psi)) ** 2)))
    found = estimate(structure, record, constraints, LAGS)
    if not isinstance(found, FittedStructure):
        return inf
    predicted = multiple_shooting(found.model, record, 1, LAGS).y[LAGS:]
    return float(np.sqrt(np.mean((record.y[LAGS:] - predicted) ** 2)))


def least_error(library, record, constraints, terms):
    return min(root_mean_square(subset, record, constraints) for subset in combinations(library, terms))


SETTINGS = [
    ("polynomial", 2, "none", 3),
    ("polynomial", 1, "hysteresis", 3),
    ("phi-polynomial", 3, "hysteresis", 3),
]


@pytest.mark.parametrize(("name", "degree", "constraints", "terms"), SETTINGS)
def test_bound_is_the_least_error_of_all_subsets(name, degree, constraints, terms):
    record, library = measured(), candidates(name, degree, LAGS, 1)
    problem = make_selection_problem(library, record, constraints)
    for certificate in SubsetSearch(problem, terms).certify(10_000)[1:]:
        expected = least_error(library, record, constraints, certificate.terms)
        assert certificate.bound <= expected * (1.0 + 1e-9)
        if name != "polynomial" or constraints == "none":
            assert certificate.bound == pytest.approx(expected, rel=1e-9)
            assert root_mean_square(certificate.structure, record, constraints) == pytest.approx(expected)
            assert certificate.proves(expected)


@settings(max_examples=25)
@given(st.integers(0, 1000), st.integers(1, 6), st.integers(1, 200))
def test_bound_with_few_nodes_is_below_that_with_many(seed, terms, nodes):
    problem = make_selection_problem(candidates("polynomial", 2, LAGS, 1), measured(seed, 100))
    few, many = (SubsetSearch(problem, terms).certify(limit)[-1] for limit in (nodes, 10_000))
    assert few.bound <= many.bound * (1.0 + 1e-9)
    assert few.nodes <= nodes
    assert SubsetSearch(problem, terms).certify(nodes)[-1] == few


def test_best_subset_is_found_where_forward_selection_fails():
    # The sum of both terms is the first choice of forward selection, and is not in the law.
    generator = np.random.default_rng(1)
    u = generator.normal(size=(300, 3))
    u[:, 2] = u[:, 0] + u[:, 1] + 0.3 * generator.normal(size=300)
    y = np.append(0.0, u[:-1, 0] + u[:-1, 1])
    problem = make_selection_problem(candidates("polynomial", 1, 1, 3), Dataset(u, y, 0.1))
    assert [item.text for item in select_forward(problem, 1)[-1]] == ["u3(k-1)"]
    certificate = SubsetSearch(problem, 2).certify(100)[-1]
    assert [item.text for item in certificate.structure] == ["u1(k-1)", "u2(k-1)"]


def test_combined_certificates_hold_for_both_libraries():
    record = measured()
    small, large = (
        SubsetSearch(make_selection_problem(candidates("polynomial", degree, LAGS, 1), record), 3).certify(
            500
        )
        for degree in (1, 2)
    )
    for both, one, other in zip(combine_certificates(small, large), small, large, strict=True):
        assert both.bound == min(one.bound, other.bound)
        assert both.nodes == one.nodes + other.nodes


def test_fit_reports_the_gap_of_every_model():
    settings = {"degree": 2, "lags": LAGS, "max_terms": 3, "estimator": "shooting"}
    found = islands.fit(measured(), library="polynomial", **settings)
    document = result_document(found.search_result)["search"]["certificates"]
    assert [entry["terms"] for entry in document] == [1, 2, 3]
    errors = {entry.model.size: entry.metrics["estimation"]["one_step_ahead"].rmse for entry in found.models}
    for entry in document:
        expected = 100.0 * max(0.0, 1.0 - entry["bound"] / errors[entry["terms"]])
        assert entry["gap_percent"] == pytest.approx(expected)
        assert entry["proved"] == (entry["gap_percent"] < 1e-4)
    assert "possible reduction of the one-step error" in method_text(found.search_result)
