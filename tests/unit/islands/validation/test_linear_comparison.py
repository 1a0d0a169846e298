"""Linear model of the same data, with which a result compares its models."""

import numpy as np
import pytest

import islands
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.report.documents.result_folder import result_document
from islands.report.text.statements import describe
from islands.validation.linear_comparison import fit_linear_comparison, is_linear

SETTINGS = {"library": "polynomial", "degree": 2, "lags": 2, "average": 1, "certificate": 0, "max_terms": 4}


def record(square):
    rng = np.random.default_rng(0)
    u, y = rng.uniform(-1.0, 1.0, 400), np.zeros(400)
    for k in range(1, 400):
        y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 1] + square * u[k - 1] ** 2
    return Dataset(u, y + 1e-3 * rng.standard_normal(400), 0.1)


@pytest.fixture(scope="module")
def curved():
    return islands.fit(record(0.3), **SETTINGS)


def sentences(document):
    return {line.partition(":")[0]: line for line in describe(document)}


def test_the_comparison_is_the_recommended_linear_model():
    parts = Split(record(0.3)[:300], record(0.3)[300:])
    found = fit_linear_comparison(parts, (), 30)
    assert is_linear(found.model)
    assert found.metrics["validation"]["free_run"].rmse < parts.validation.y.std()
    exact = fit_linear_comparison(Split(record(0.0)[:300], record(0.0)[300:]), (), 30)
    assert exact.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert fit_linear_comparison(Split(record(0.0)[:4], record(0.0)[4:]), (), 3) is None


def test_a_result_states_the_ratio_to_a_linear_model(curved):
    document = result_document(curved.search_result)
    linear, own = document["linear"], document["models"][document["recommended"]["rank"] - 1]
    errors = [each["metrics"]["validation"]["free_run"]["rmse"] for each in (linear, own)]
    assert errors[0] > 5.0 * errors[1]
    stated = f"a linear model of {linear['size']} terms has {errors[0] / errors[1]:.3g} times the error."
    assert sentences(document)["Error"].endswith(stated)
    (row,) = (line.split() for line in str(curved).splitlines() if line.startswith("lin."))
    assert row[1] == str(linear["size"])
