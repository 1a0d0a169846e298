"""Report: keys of the document, and goals that are met or missed."""

import json
from dataclasses import replace

import pytest

from islands_measurements.speed.full_runs import Run
from islands_measurements.speed.machine import this_machine
from islands_measurements.speed.report import check_goals, to_document
from islands_measurements.speed.scaling import Scaling
from support.made_reports import KINDS, POINTS, comparison, report


def test_document_has_every_key_and_is_json():
    found = json.loads(json.dumps(to_document(report())))
    assert found["evaluation_ratio_numpy_uncached"] == pytest.approx(80.0)
    # The search took 8 s for 100 000 new structures.
    assert found["evaluation_ratio_numpy_amortised"] == pytest.approx(24.0 / 0.08)
    assert found["simulation_fraction_of_c"] == 0.5
    assert found["gram_fraction_of_peak"] == 0.5
    assert found["evaluations_per_second_per_core"] == {"n100000": 12_500.0, "n10000": 25_000.0}
    assert found["case1_wall_s"] == 9.5
    assert found["parallel_efficiency_2"] == 0.97
    assert found["numpy_ms"] == dict.fromkeys(KINDS, 24.0)
    assert found["uncached_ms"] == dict.fromkeys(KINDS, 0.3)
    assert found["amortised_ms"] == {"poly": 0.1, "general": 0.1, "gp": pytest.approx(0.08)}
    assert found["workload_sha256"] == "ab" * 32
    assert set(found["scaling"]) == {"samples", "terms", "tree_size", "islands"}
    curve = found["scaling"]["terms"]["curves"]["nothing cached"]
    assert curve["points"] == [list(point) for point in POINTS]
    assert curve["line"] == pytest.approx({"intercept": 1.0, "slope": 1.0, "r2": 1.0})
    assert found["caches"]["n100000"] == {"duplicate_share": 0.2, "inner_products_bytes": 1000}
    assert found["machine"]["processor"] == "a processor"
    assert found["quick"] is False
    assert set(found["kinds"]) == set(KINDS)


def test_single_values_are_those_of_a_search():
    kinds = {
        "poly": comparison(uncached_ms=1.0, simulation_fraction_of_c=0.1, gram_flops=1e10),
        "general": comparison(uncached_ms=1.0, simulation_fraction_of_c=0.1, gram_flops=1e10),
        "gp": comparison(),
    }
    found = to_document(report(kinds=kinds))
    assert found["evaluation_ratio_numpy_uncached"] == pytest.approx(80.0)
    assert found["simulation_fraction_of_c"] == 0.5
    assert found["gram_fraction_of_peak"] == 0.5
    assert found["kinds"]["poly"]["evaluation_ratio_numpy_uncached"] == pytest.approx(24.0)
    assert found["kinds"]["poly"]["gram_fraction_of_peak"] == pytest.approx(0.1)


def met(changed):
    return {goal.text: goal.met for goal in check_goals(changed)}


def test_every_goal_is_met_by_a_fast_machine():
    assert set(met(report()).values()) == {True}
    assert len(met(report())) == 11


SLOW_RUN = Run(125_000, 25_000, 100.0, 110.0, 80.0, {})
BENT = Scaling("samples", "", "", {"nothing cached": ((1.0, 1.0), (2.0, 9.0), (3.0, 1.0))})


def kinds(**changed):
    return {kind: changed.get(kind, comparison()) for kind in KINDS}


@pytest.mark.parametrize(
    ("changes", "missed"),
    [
        ({"kinds": kinds(poly=comparison(uncached_ms=24.0 / 59.9))}, "nothing cached, over numpy: poly"),
        ({"kinds": kinds(gp=comparison(uncached_ms=24.0 / 59.9))}, "nothing cached, over numpy: gp"),
        ({"kinds": kinds(general=comparison(uncached_ms=24.0 / 44.9))}, "over numpy: general"),
        ({"kinds": kinds(gp=comparison(numpy_ms=119.0 * 0.08, uncached_ms=0.1))}, "amortised"),
        ({"kinds": kinds(poly=comparison(simulation_fraction_of_c=0.39))}, "compiled C's speed: poly"),
        ({"kinds": kinds(general=comparison(simulation_fraction_of_c=0.29))}, "compiled C's speed: general"),
        ({"case1_wall_s": 20.1}, "case 1"),
        ({"parallel_efficiency_2": 0.94}, "second island"),
        ({"runs": {"n100000": replace(SLOW_RUN, evaluating_cpu_s=8.0)}}, "toolbox"),
        ({"scalings": (BENT,)}, "against samples is a line"),
    ],
)
def test_insufficient_value_misses_only_its_goal(changes, missed):
    short = [text for text, reached in met(report(**changes)).items() if reached is False]
    assert len(short) == 1
    assert missed in short[0]


def test_goal_for_general_trees_is_lower():
    assert set(met(report(kinds=kinds(general=comparison(uncached_ms=24.0 / 46)))).values()) == {True}


def test_goal_without_a_measurement_is_neither_met_nor_missed():
    without = {kind: comparison(c_simulation_ms=None, simulation_fraction_of_c=None) for kind in KINDS}
    changed = report(kinds=without, peak_flops=None, case1_wall_s=None)
    unknown = [text for text, reached in met(changed).items() if reached is None]
    assert len(unknown) == 3
    found = to_document(changed)
    for name in ("simulation_fraction_of_c", "gram_fraction_of_peak", "case1_wall_s", "peak_flops"):
        assert found[name] is None
    shown = {goal.measured for goal in check_goals(changed) if goal.met is None}
    assert shown == {"no C compiler", "not measured"}


def test_machine_is_described():
    found = this_machine()
    assert found.processor
    assert found.cores >= 1
    assert {"numpy", "numba", "islands"} <= set(found.packages)
