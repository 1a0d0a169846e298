"""Searches of a reproduction: deterministic, with the validated model of the hall, with and without rule."""

import pytest

from islands.records.dataset import Dataset
from islands.reproduction.searches import measure_errors, model_document, read_document, search_island
from islands.systems.bouc_wen import authors_estimation, authors_validation
from islands.systems.published_models import PUBLISHED


@pytest.fixture(scope="module")
def records():
    return authors_estimation()[:3000], {
        "short": authors_validation()[:1000],
        "long": authors_validation()[:3000],
    }


def search(records, **changes):
    estimation, validation = records
    settings = {"population": 60, "generations": 4}
    return search_island(estimation, validation, "paper-case1", settings, 3, simulate_holds=False, **changes)


@pytest.fixture(scope="module")
def found(records):
    return search(records)


def test_a_search_repeats_bit_for_bit(records, found):
    assert search(records) == found


def test_selected_model_has_the_stated_errors(records, found):
    model = read_document(found["selected"], records[0])
    assert measure_errors(model, {"estimation": records[0], **records[1]}) == found["selected"]["errors"]


def test_trace_covers_all_generations_and_its_error_decreases(found):
    assert [point["generation"] for point in found["trace"]] == [0, 1, 2, 3, 4]
    errors = [point["rmse"] for point in found["trace"]]
    assert errors == sorted(errors, reverse=True)
    assert found["evaluations"] == 5 * 60


def test_only_without_the_root_rule_the_hall_has_models_that_do_not_converge(records, found):
    assert found["hall"]["converging"] == found["hall"]["models"]
    free = search(records, root_rule=False)
    assert free["hall"]["converging"] < free["hall"]["models"]


def test_a_diverged_model_has_no_error(records):
    model = PUBLISHED["13"].model
    unstable = model.with_parameters([1.5, *model.parameters[1:]])
    assert measure_errors(unstable, {"estimation": records[0]}) == {"estimation": {"mape": None, "r2": None}}


def test_a_model_survives_its_document():
    model = PUBLISHED["12"].model
    record = Dataset([0.0] * 4, [0.0] * 4, 1e-3, ("u_V",), "y_um", ("V",), "um")
    assert read_document(model_document(model), record) == model
