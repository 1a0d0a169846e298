"""Rows of a benchmark: median and worst over the seeds, and reasons in place of errors."""

import json
from dataclasses import asdict
from itertools import count

import pytest

from islands.benchmarks import comparison
from islands.benchmarks.comparison import ComparisonSettings, SeedOutcome, compare, make_rows
from islands.benchmarks.definition import (
    LATENT,
    LINEAR,
    NARX,
    Benchmark,
    BenchmarkData,
    BenchmarkTest,
    PublishedError,
)
from islands.benchmarks.model_searches import FoundModel, ModelSearch
from islands.errors import SettingsError
from islands.progress import StoppedError
from support.latent_systems import SPRING, make_model, spring_record

SET = Benchmark(
    description="A spring.",
    published={"test": (PublishedError(0.5, "method", "source"),)},
    unit="um",
    scale=1e3,
    rule="a rule",
    address="doi 10.1/2",
    licence="MIT",
    read=lambda _folder: pytest.fail("read"),
    is_tuned=True,
)


def outcome(seed, error, parameters=7, claimed=None, coverage=None):
    return SeedOutcome(seed, {"test": error}, 2, parameters, 1.0 + seed, claimed, {"test": coverage})


def rows_of(outcomes):
    return {row.model: row for row in make_rows("spring", SET, ["test"], outcomes)}


def data():
    return BenchmarkData(spring_record(300), {"test": BenchmarkTest(spring_record(200, seed=4), 30, 30)})


def use(monkeypatch, **searches):
    """Replace the searches by functions of the seed, the progress callback and the stop request."""
    table = {
        name: ModelSearch(
            lambda _record, *rest, each=each: FoundModel(each(*rest), 0.5), is_random=name == LATENT
        )
        for name, each in searches.items()
    }
    monkeypatch.setattr(comparison, "MODEL_SEARCHES", table)


def run(settings, stop=lambda: False, progress=lambda _message, _fraction=None: None):
    clock = count().__next__
    return compare("spring", SET, data(), settings, lambda: float(clock()), progress, stop)


def test_a_row_has_the_median_and_the_worst_of_the_seeds():
    found = rows_of(
        {LATENT: [outcome(0, 0.3), outcome(1, 0.1), outcome(2, 0.2, 9)], LINEAR: [outcome(0, 4.0)]}
    )
    row = found[LATENT]
    assert (row.median, row.worst, row.linear) == (0.2, 0.3, 4.0)
    assert [each.error for each in row.per_seed] == [0.3, 0.1, 0.2]
    assert (row.terms, row.parameters, row.wall_s) == (2, 7, 2.0)
    assert (row.metric, row.unit, row.is_tuned) == ("RMSE", "um", True)
    assert row.published == SET.published["test"]
    assert found[LINEAR].linear == 4.0


def test_a_row_has_the_medians_of_claims_and_coverages_that_are_known():
    found = rows_of(
        {
            LATENT: [outcome(0, 0.3, 7, 0.2, 0.8), outcome(1, "reason"), outcome(2, 0.4, 7, 0.4, 0.9)],
            LINEAR: [outcome(0, 4.0)],
        }
    )
    assert (found[LATENT].claimed, found[LATENT].coverage) == pytest.approx((0.3, 0.85))
    assert [(each.claimed, each.coverage) for each in found[LATENT].per_seed] == [
        (0.2, 0.8),
        (None, None),
        (0.4, 0.9),
    ]
    assert (found[LINEAR].claimed, found[LINEAR].coverage) == (None, None)


def test_a_seed_without_an_error_counts_as_infinite():
    row = rows_of({LATENT: [outcome(0, 0.3), outcome(1, "the free run diverges"), outcome(2, 0.2)]})[LATENT]
    assert (row.median, row.worst, row.linear) == (0.3, None, None)
    assert row.per_seed[1].reason == "the free run diverges"
    json.dumps(asdict(row), allow_nan=False)


def test_a_class_without_a_model_has_a_row():
    (row,) = make_rows(
        "spring",
        SET,
        ["test"],
        {NARX: [SeedOutcome(0, {"test": "no model of several outputs"}, None, None, 0.1)]},
    )
    assert (row.median, row.worst, row.terms, row.parameters) == (None, None, None, None)
    assert row.per_seed[0].reason == "no model of several outputs"


@pytest.mark.ci
def test_each_class_is_measured_on_the_tests_in_the_unit_of_the_set(monkeypatch):
    half = make_model({**SPRING, "c1": 0.6})
    messages = []
    use(monkeypatch, latent=lambda *_: make_model(), linear=lambda *_: half)
    found = run(
        ComparisonSettings((LATENT, LINEAR), seeds=2), progress=lambda *report: messages.append(report)
    )
    assert [(row.model, len(row.per_seed)) for row in found] == [(LATENT, 2), (LINEAR, 1)]
    assert found[0].median < 1.0
    assert found[1].median == found[0].linear > 100.0
    assert (found[0].terms, found[0].parameters) == (1, 10)
    assert (found[0].claimed, found[0].coverage) == (500.0, None)
    assert messages[-1] == ("spring, linear, seed 0: test test", 1.0)


def test_the_budget_stops_a_search(monkeypatch):
    """The clock advances by a second at each reading."""

    def search(_seed, _progress, stop):
        while not stop():
            pass
        return make_model()

    def without_model(_seed, _progress, stop):
        assert stop()
        raise StoppedError("starts")

    use(monkeypatch, latent=search, narx=without_model)
    one, other = run(ComparisonSettings((LATENT, NARX), budget=1.0))
    assert one.median is not None
    assert other.per_seed[0].reason == "the budget ends before the first model, at: starts"


def test_a_stop_keeps_the_complete_searches(monkeypatch):
    asked = []
    use(monkeypatch, latent=lambda seed, *_: asked.append(seed) or make_model())
    (row,) = run(ComparisonSettings((LATENT,), seeds=5), stop=lambda: len(asked) > 2)
    assert [each.seed for each in row.per_seed] == [0, 1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"classes": ("spline",)}, "unknown class of models 'spline'"),
        ({"classes": (NARX, NARX)}, "each class of models once"),
        ({"seeds": 0}, "seeds is at least 1"),
        ({"budget": 0.0}, "positive number of seconds"),
    ],
)
def test_invalid_settings_are_errors(options, message):
    with pytest.raises(SettingsError, match=message):
        ComparisonSettings(**options)
