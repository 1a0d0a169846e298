"""Case 1: its tasks, and tables whose sentences follow from the results."""

import json

import pytest

from islands.evolution.presets import PRESETS
from islands.reproduction import case1
from islands.reproduction.ablation import LITERAL, SWITCHES
from islands.reproduction.section import WHY
from islands.reproduction.tasks import ReproductionOptions
from support.undrawn import undrawn_figures

#: The published models are assessed on the authors' record, which takes a second.
pytestmark = pytest.mark.ci

OPTIONS = ReproductionOptions(seeds=3, quick=False)


def search(name, seed, error, size=9):
    trace = [{"generation": point, "models": 40, "converging": 40, "rmse": 1.0} for point in (0, 500)]
    errors = {"mape": error, "r2": 0.999}
    selected = {
        "size": size,
        "errors": dict.fromkeys(("estimation", "validation_10s", "validation_100s"), errors),
        "property_1": True,
    }
    return {
        "seed": seed,
        "generations": 500,
        "population": 500,
        "trace": trace,
        "hall": {"models": 40, "converging": 40, "property_1": 39 if name == LITERAL else None},
        "selected": None if error is None else selected,
    }


@pytest.fixture(scope="module")
def section():
    """Return the section of given searches; the published models are assessed on the records."""
    results = {"case1-published": case1.assess_models(2)}
    sine = {"sine_5hz": {"mape": 0.2, "r2": 1.0}}
    ours = search("ours", 0, 0.1, 6)["selected"]
    ours = {**ours, "errors": {**ours["errors"], **sine}}
    results["case1-preset"] = {
        "6": ours,
        "9": ours,
        "published_13": {
            **results["case1-published"]["13"]["estimated"],
            "sine_5hz": {"mape": 0.8, "r2": 1.0},
        },
    }
    errors = {0: 0.1, 1: 0.505, 2: None}
    for task in case1.plan(OPTIONS):
        if task.function is case1.search_literally:
            name, seed, *_ = task.arguments
            results[task.key] = search(name, seed, errors[seed])
    return case1.summarise(results, OPTIONS)


def rows(section, title):
    (table,) = (table for table in section.tables if table.title.startswith(title))
    return table.rows


def test_the_whole_form_runs_every_switch_with_every_seed_at_the_printed_size():
    tasks = [task for task in case1.plan(OPTIONS) if task.function is case1.search_literally]
    assert {task.arguments[:2] for task in tasks} == {(name, seed) for name in SWITCHES for seed in range(3)}
    assert {task.arguments[2] for task in tasks} == {PRESETS["paper-case1"].generations}


def test_the_short_form_has_fewer_and_shorter_searches():
    short = [
        task
        for task in case1.plan(ReproductionOptions(quick=True))
        if task.function is case1.search_literally
    ]
    assert len(short) < len(SWITCHES) * 10 / 4
    assert max(task.arguments[2] for task in short) < PRESETS["paper-case1"].generations / 10


@pytest.mark.parametrize("quick", [False, True])
def test_keys_are_different(quick):
    keys = [task.key for task in case1.plan(ReproductionOptions(quick=quick))]
    assert len(set(keys)) == len(keys)


def test_every_row_of_every_table_has_a_reason(section):
    for table in section.tables:
        assert table.columns[-1] == WHY
        assert all(row[-1] for row in table.rows)


def test_seeds_are_compared_with_the_published_error(section):
    seeds = rows(section, "The literal search, seed by seed")
    assert [row[0] for row in seeds] == ["(13), published", "seed 0", "seed 1", "seed 2"]
    assert "0.40 times the published error, as many terms" in seeds[1][-1]
    assert "2.00 times" in seeds[2][-1]
    assert "diverges" in seeds[3][-1]


def test_goals_count_the_seeds_that_support_them(section):
    table = next(table for table in section.tables if table.title == "The literal search")
    goals = {row[0]: row for row in table.rows}
    median = goals["median MAPE % of 3 seeds, validation, 100 s"]
    assert (median[1], median[2]) == ("0.25250", "0.5050")
    assert median[3].startswith("1 of 3 seeds have a smaller error")
    assert goals["final hall with Property 1"][2:] == ("120 of 120", "with simulated holds: 117 of 120")


def test_our_preset_is_compared_with_the_published_models_and_on_a_test_record(section):
    found = rows(section, "Our preset")
    assert found[0][:3] == ("at most 6 terms: estimation", "0.32874", "0.1000")
    assert "0.25 times the error of (13), estimated again (0.8000)" in found[3][-1]


def test_table_1_has_the_printed_and_the_estimated_model(section):
    row = next(row for row in rows(section, "Table 1") if row[0] == "(13), MAPE %, estimation")
    assert row[1] == "0.31189"
    assert float(row[3]) == pytest.approx(0.31189, abs=1e-3)
    assert float(row[2]) < 0.30
    longer = next(row for row in rows(section, "Table 1") if row[0] == "(13), MAPE %, validation, 100 s")
    assert "10 s are nearer to the published value" in longer[-1]


def test_numbers_of_the_section_are_json(section):
    assert json.loads(json.dumps(section.document, allow_nan=False)) == section.document


def test_figures_show_the_records_and_the_searches(section):
    with undrawn_figures():
        drawn = {figure.name: figure.draw("light") for figure in section.figures}
    assert list(drawn) == ["figure-4a", "figure-5", "case1-property-1", "case1-ablation"]
    assert len(drawn["figure-5"].axes) == 4
    assert len(drawn["case1-property-1"].axes[0].lines) == 6
