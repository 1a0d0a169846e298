"""Results of a search: ranking of models, and statistics."""

import itertools
from math import nan

import islands
from islands.evolution.search_result import rank_models
from islands.validation.assessment import Assessment
from islands.validation.metrics import Metrics


def entry(free_run, one_step=0.1, terms=("y(k-1)",), theta=0.5):
    """Return a ranked model with given errors on the validation data."""
    errors = {
        "estimation": {"one_step_ahead": Metrics(0, 0, 0, 0), "free_run": Metrics(0, 0, 0, 0)},
        "validation": {
            "one_step_ahead": Metrics(nan, nan, one_step, nan),
            "free_run": Metrics(nan, nan, free_run, nan),
        },
    }
    model = islands.make_model([(islands.parse(text), theta) for text in terms])
    return Assessment(model, errors, {}, None, None, 0, ())


def assert_ranked_in_any_order(*expected):
    for order in itertools.permutations(expected):
        assert [id(item) for item in rank_models(order)] == [id(item) for item in expected]


def test_models_are_ranked_by_free_run_error_on_validation_data():
    assert_ranked_in_any_order(entry(0.1, one_step=9.0), entry(0.2, one_step=1.0), entry(30.0, one_step=0.0))


def test_diverged_models_come_last_by_one_step_ahead_error():
    assert_ranked_in_any_order(entry(1e9, one_step=5.0), entry(nan, one_step=0.1), entry(nan, one_step=0.2))


def test_ties_are_broken_by_size_and_then_by_text():
    small, large = ("y(k-1)",), ("u(k-1)", "u(k-2)")
    assert_ranked_in_any_order(entry(0.1, terms=small), entry(0.1, terms=large))
    assert_ranked_in_any_order(
        entry(0.1, terms=("u(k-1)",)), entry(0.1, terms=("u(k-2)",)), entry(0.1, terms=("y(k-1)",))
    )
    assert_ranked_in_any_order(entry(nan, 0.3, small), entry(nan, 0.3, large))
