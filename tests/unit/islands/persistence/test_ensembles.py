"""Ensemble in ``result.json``: round trip, and clear errors for folders without one."""

import json
from functools import cache

import numpy as np
import pytest

import islands
from islands.errors import ModelError
from islands.persistence.ensembles import (
    bands_document,
    bands_from_document,
    ensemble_document,
    ensemble_from_document,
)
from islands.report.documents.result_folder import write_result


@cache
def result():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(300)
    y = np.zeros(300)
    for k in range(1, 300):
        y[k] = 0.6 * y[k - 1] + 0.3 * u[k - 1] + 0.1 * y[k - 1] * u[k - 1]
    record = islands.Dataset(u, y + 0.01 * rng.standard_normal(300), 0.1, input_names=("u_V",))
    return islands.fit(record, library="polynomial", degree=2, lags=2, max_terms=4)


@pytest.fixture
def folder(tmp_path):
    write_result(result().search_result, tmp_path)
    return tmp_path


def test_a_result_folder_reproduces_the_bands_bit_for_bit(folder):
    for model in result().models:
        file = folder / "models" / f"{model.rank:02d}.json"
        bands = islands.load(file).prediction_bands
        expected = result().search_result.ensemble
        own = model.prediction_bands
        assert (bands.noise, bands.width, bands.factors) == (own.noise, own.width, own.factors)
        assert own.data_range is not None
        assert (bands.coverage, bands.data_range) == (own.coverage, own.data_range)
        for found, each in zip(bands.ensemble.structures, expected.structures, strict=True):
            assert (found.model, found.weight) == (each.model, each.weight)
            assert (found.parameters == each.parameters).all()


def test_terms_have_their_inclusion_probability_in_a_result(folder):
    document = json.loads((folder / "result.json").read_text())
    for model, entry in zip(result().models, document["models"], strict=True):
        known = tuple(term["inclusion"] for term in entry["terms"] if term["inclusion"] is not None)
        assert known == model.inclusion


def test_no_ensemble_and_no_bands_are_null():
    assert ensemble_document(None) is None
    assert ensemble_from_document(None, result().best.model) is None
    assert bands_document(None) is None
    assert bands_from_document(None, result().search_result.ensemble) is None


@pytest.mark.parametrize(
    "damage",
    [
        {"weight": 2.0},
        {"regressors": ["y(k-1)"]},
        {"regressors": ["2*y(k-1)"], "parameters": [[1.0]]},
        {"regressors": ["y(k+1)"], "parameters": [[1.0]]},
        {"parameters": [["x"]]},
        {"parameters": []},
    ],
)
def test_a_damaged_ensemble_is_refused(damage):
    document = [{**ensemble_document(result().search_result.ensemble)[0], **damage}]
    with pytest.raises(ModelError, match="damaged"):
        ensemble_from_document(document, result().best.model)


def test_damaged_bands_are_refused():
    document = {**bands_document(result().best.prediction_bands), "levels": [0.9]}
    with pytest.raises(ModelError, match="damaged"):
        bands_from_document(document, result().search_result.ensemble)
