"""Linear model of the same data, with which a result compares its models."""

import numpy as np
import pytest

import islands
from islands.models.form import is_linear
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.report.documents.result_folder import result_document
from islands.report.text.statements import describe
from islands.validation.simple_models import assess_linear_model

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


@pytest.mark.ci
def test_a_linear_law_is_recommended_as_linear_and_a_curve_is_not(curved):
    straight = islands.fit(record(0.0), **SETTINGS)
    assert is_linear(straight.best.model)
    assert straight.search_result.linear is None
    assert not is_linear(curved.best.model)
    kinds = [each.model.kind for each in curved.models if is_linear(each.model)]
    assert "latent" in kinds


@pytest.mark.ci
def test_a_step_alone_shows_a_linear_law():
    """The validation data have no excitation: every model of the level is as good there."""
    rng, u = np.random.default_rng(1), np.where(np.arange(400) < 20, 0.0, 1.0)
    y = np.zeros(400)
    for k in range(1, 400):
        y[k] = 0.95 * y[k - 1] + 0.1 * u[max(k - 8, 0)]
    found = islands.fit(Dataset(u, y + 0.02 * rng.standard_normal(400), 0.5), **SETTINGS)
    assert is_linear(found.best.model)
    assert "information criterion of the free run on all data" in found.recommendation.reasons[0]


def test_data_that_are_too_short_have_no_linear_model():
    assert assess_linear_model(Split(record(0.0)[:4], record(0.0)[4:]), 3) is None
    parts = Split(record(0.0)[:300], record(0.0)[300:])
    assert assess_linear_model(parts, 30, constraints="hysteresis") is None


def test_a_result_states_the_ratio_to_a_linear_model(curved):
    document = result_document(curved.search_result)
    linear, own = document["linear"], document["models"][document["recommended"]["rank"] - 1]
    errors = [each["metrics"]["validation"]["free_run"]["rmse"] for each in (linear, own)]
    assert errors[0] > 5.0 * errors[1]
    size = f"{linear['size']} parameters ({linear['structure']})"
    stated = f"a linear model of {size} has {errors[0] / errors[1]:.3g} times the error."
    assert sentences(document)["Error"].endswith(stated)
