"""Workload: reproducible individuals and their hash."""

from dataclasses import replace
from math import isfinite

import pytest

from islands.errors import ModelError
from islands.evolution.evaluation import Evaluator
from islands.evolution.individual import Individual
from islands.expressions.parsing import parse
from islands.expressions.tree import Apply, Lagged, height
from islands.models.narx import Model
from islands.simulation.predictors import multiple_shooting
from islands_measurements.speed import workload as module
from islands_measurements.speed.workload import (
    INTERVAL,
    ISLAND,
    MAX_LAG,
    WARM_UP,
    WorkloadModel,
    benchmark_record,
    candidate_text,
    evolved_workload,
    fingerprint,
    full_tree,
    monomial,
    random_workload,
    tree,
)


def kinds(count=2):
    return {"poly": random_workload(monomial, count), "general": random_workload(tree, count)}


def test_workload_hash_is_reproducible_and_pinned():
    # A change here makes all earlier reports incomparable, because the baseline does other work.
    assert fingerprint(kinds()) == fingerprint(kinds())
    assert fingerprint(kinds(30)).startswith("0023c13333ef")


def test_workload_hash_depends_on_kinds_individuals_and_terms():
    one = kinds()
    first = one["poly"][0]
    fewer = WorkloadModel(first.regressors[:-1], first.theta[:-1], first.constraints)
    others = [
        {"poly": one["general"], "general": one["poly"]},
        {**one, "poly": one["poly"][:1]},
        {**one, "poly": (fewer, *one["poly"][1:])},
        {"general": one["general"]},
    ]
    hashes = {fingerprint(each) for each in (one, *others)}
    assert len(hashes) == 1 + len(others)


def test_workload_text_lists_kinds_individuals_and_terms():
    text = candidate_text({"poly": random_workload(monomial, 1, terms=1)})
    assert text.splitlines() == ["100000 samples", "poly", "individual", "y(k-1)"]


@pytest.mark.parametrize("make", [monomial, tree])
@pytest.mark.parametrize("terms", [1, 10])
def test_random_individuals_have_distinct_terms_and_y(make, terms):
    for each in random_workload(make, 4, terms):
        assert len(each.regressors) == len(set(each.regressors)) == len(each.theta) == terms
        assert each.regressors[0].text == "y(k-1)"
        assert each.theta[0] == 0.97
        assert each.constraints == "none"
        assert max(item.maximum_lag for item in each.regressors) <= MAX_LAG
        Model(each.regressors, each.theta)


def test_larger_workload_starts_with_the_same_individuals():
    assert random_workload(tree, 5)[:2] == random_workload(tree, 2)


@pytest.mark.parametrize("edges", [0, 1, 3])
def test_full_tree_has_every_leaf_at_its_height(edges):
    import random

    def depths(expression, depth=0):
        match expression:
            case Apply(_, arguments):
                return {found for each in arguments for found in depths(each, depth + 1)}
            case Lagged():
                return {depth}

    expression = full_tree(random.Random(4), edges)
    assert depths(expression) == {edges} == {height(expression)}


@pytest.fixture(scope="module")
def piezo():
    return benchmark_record(12_000)


def test_record_is_in_units_of_three_standard_deviations(piezo):
    assert piezo.samples == 12_000
    assert piezo.y.std() == pytest.approx(1 / 3, rel=0.2)
    assert benchmark_record(500).y.tolist() == piezo.y[:500].tolist()


def test_evolved_individuals_are_reproducible_and_bounded(piezo):
    short = replace(ISLAND, population=12, generations=6)
    found = evolved_workload(piezo, 4, short)
    assert found == evolved_workload(piezo, 4, short)
    assert len(found) == 4
    assert {each.constraints for each in found} == {"hysteresis"}
    for each in found:
        simulated = multiple_shooting(Model(each.regressors, each.theta), piezo, INTERVAL, WARM_UP)
        assert simulated.outcome
        assert isfinite(simulated.mean_squared_error)


def test_evolved_individuals_are_spread_over_the_search(piezo, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "_find_bounded", lambda individuals, _evaluator: asked.append(individuals))
    evolved_workload(piezo, 3, replace(ISLAND, population=12, generations=8))
    bred = asked[-1][::-1]
    # Nine populations without the duplicates.
    assert 12 < len(bred) <= 9 * 12
    assert [each[0] for each in asked] == [bred[len(bred) // 3 - 1], bred[2 * len(bred) // 3 - 1], bred[-1]]
    assert all(genes.genes for genes in bred)


def test_diverging_individual_is_replaced_by_the_next(piezo):
    evaluator = Evaluator(piezo, ISLAND)
    # Without y(k-1) the sum of the parameters can't be one.
    infeasible = Individual((parse("u(k-1)"),))
    usable = Individual((parse("y(k-1)"), parse("y(k-1)*phi1(u(k-1), u(k-2))")))
    found = module._find_bounded([infeasible, usable, infeasible], evaluator)
    assert next(item.text for item in found.regressors) == "y(k-1)"
    with pytest.raises(ModelError, match="every individual"):
        module._find_bounded([infeasible], evaluator)
