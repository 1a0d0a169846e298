"""Appendix A: runs, published numbers, the likelihood of a scan, Tukey's test and the section."""

from collections import Counter
from math import exp, inf, log

import numpy as np
import pytest
from scipy import stats

from islands.evolution.presets import PRESETS
from islands.facade.identify import identify
from islands.report.figures.themes import THEMES
from islands.reproduction import appendix_a
from islands.reproduction.appendix_a import (
    PROBABILITIES,
    PUBLISHED,
    SCANNED,
    STATED_VARIANCE,
    TABLE_A3,
    VARIANCES,
    AppendixRun,
    compare_means,
    expected_counts,
    interval,
    log_likelihood,
    plan,
    read_runs,
    run_searches,
    summarise,
)
from islands.reproduction.tasks import ReproductionOptions
from islands.systems import appendix
from islands.systems.appendix import SOFT_VARIANCE

pytestmark = pytest.mark.ci


def make_runs(count, unstable=0, size=10, prediction=1.0):
    return [
        AppendixRun(seed, size, 0.1, prediction + 0.01 * seed, inf if seed < unstable else 2.0)
        for seed in range(count)
    ]


def make_results(options, unstable=lambda _system, _prune: 0):
    """Return results of a plan with made runs; sizes and errors depend on the pruning probability."""
    results = {}
    for task in plan(options):
        system, _, prune, first, count = task.arguments
        results[task.key] = {
            "runs": [
                {
                    "seed": seed,
                    "equation": "y(k) = y(k-1)",
                    "size": 10 - round(4 * prune),
                    "training": 0.1,
                    "prediction": 20.0 - 15.0 * prune + 1.5 * (seed % 10) * (1.1 - 0.2 * prune),
                    "simulation": None if seed < unstable(system, prune) else 30.0,
                }
                for seed in range(first, first + count)
            ]
        }
    return results


# Published numbers.


def test_table_a3_agrees_with_itself():
    """Differences of means add up, and equality is rejected if the interval excludes zero (Table A.3)."""
    for (one, other), (difference, rejected) in TABLE_A3.items():
        assert rejected == (abs(difference) > 6.7601)
        if one > 0.0:
            assert TABLE_A3[0.0, other][0] - TABLE_A3[0.0, one][0] == pytest.approx(difference, abs=2e-4)
    assert sum(rejected for _, rejected in TABLE_A3.values()) == 5


# Runs.


def test_a_run_takes_the_model_that_select_fitness_recommends():
    (found,) = run_searches("s1", 0.1, 0.5, 7, 1)["runs"]
    record, white = appendix.soft_record(appendix.S1, 7, variance=0.1), appendix.white_record(appendix.S1, 7)
    result = identify(record, validation=white, preset="paper-appendix", prune=0.5, seed=7, select="fitness")
    metrics = result.best.metrics
    assert result.best.model.size == found["size"]
    assert metrics["estimation"]["one_step_ahead"].rmse ** 2 == pytest.approx(found["training"], rel=1e-6)
    assert metrics["validation"]["one_step_ahead"].mape == pytest.approx(found["prediction"], rel=1e-6)
    assert metrics["validation"]["free_run"].mape == pytest.approx(found["simulation"], rel=1e-6)


def test_runs_do_not_depend_on_their_batch(monkeypatch):
    small = appendix_a.replace(PRESETS["paper-appendix"], population=10, generations=2)
    monkeypatch.setattr(appendix_a, "PRESETS", {"paper-appendix": small})
    together = run_searches("s1", 0.1, 0.5, 0, 2)["runs"]
    apart = [run_searches("s1", 0.1, 0.5, seed, 1)["runs"][0] for seed in (0, 1)]
    assert together == apart
    assert together[0] != {**together[1], "seed": 0}


# Plan.


def test_the_plan_has_fifty_runs_of_every_probability_and_a_scan():
    runs = Counter()
    for task in plan(ReproductionOptions()):
        system, variance, prune, first, count = task.arguments
        assert first == runs[system, variance, prune]
        runs[system, variance, prune] += count
    for system in ("s1", "s2"):
        assert [runs[system, SOFT_VARIANCE, prune] for prune in PROBABILITIES] == 5 * [50]
    assert [runs["s2", STATED_VARIANCE, prune] for prune in PROBABILITIES] == 5 * [50]
    for variance in VARIANCES:
        assert all(runs[system, variance, prune] >= count for (system, prune), count in SCANNED.items())


def test_fewer_runs_are_a_part_of_more():
    keys = {task.key: task for task in plan(ReproductionOptions())}
    fewer = plan(ReproductionOptions(runs=10))
    assert len(fewer) < len(keys)
    assert all(keys[task.key] == task for task in fewer)


def test_the_quick_plan_has_a_few_runs_of_s1():
    tasks = plan(ReproductionOptions(quick=True))
    assert {task.arguments[:3] for task in tasks} == {("s1", SOFT_VARIANCE, 0.0), ("s1", SOFT_VARIANCE, 1.0)}
    assert sum(task.arguments[4] for task in tasks) <= 6


# Statistics.


def test_interval_is_that_of_clopper_and_pearson():
    low, high = interval(20, 50)
    assert stats.binom.sf(19, 50, low) == pytest.approx(0.025, rel=1e-6)
    assert stats.binom.cdf(20, 50, high) == pytest.approx(0.025, rel=1e-6)
    assert interval(0, 50)[0] == 0.0
    assert interval(50, 50)[1] == 1.0


@pytest.mark.parametrize(("count", "runs"), [(0, 10), (4, 10), (48, 50), (20, 50)])
def test_counts_outside_the_expected_range_are_rare(count, runs):
    low, high = expected_counts(count, runs)
    rng = np.random.default_rng(0)
    drawn = rng.binomial(50, rng.beta(count + 0.5, runs - count + 0.5, 100_000))
    assert np.mean(drawn < low) < 0.027
    assert np.mean(drawn > high) < 0.027
    assert np.mean(drawn <= low) > 0.023
    assert np.mean(drawn >= high) > 0.023
    # The count here, scaled to 50 runs, is in the range.
    assert low <= count * 50 / runs <= high


def test_likelihood_is_the_beta_binomial_probability_of_the_published_count():
    """It is the binomial probability, integrated over the posterior of the proportion."""
    runs = make_runs(10, unstable=4, size=3)
    shares = (np.arange(200_000) + 0.5) / 200_000
    posterior = stats.beta(4.5, 6.5).pdf(shares)
    unstable = np.mean(posterior * stats.binom.pmf(20, 50, shares))
    size_10 = np.mean(stats.beta(0.5, 10.5).pdf(shares) * stats.binom.pmf(50, 50, shares))
    found = log_likelihood({("s1", 0.0): runs})
    assert found == pytest.approx(log(unstable) + log(size_10), rel=1e-6)


def test_likelihood_is_largest_for_the_counts_and_sizes_of_the_paper():
    def likelihood(unstable, size, last):
        return log_likelihood(
            {
                ("s1", 0.0): make_runs(50, unstable=unstable),
                ("s1", 1.0): make_runs(50, unstable=1, size=size),
                ("s2", 0.0): make_runs(50, unstable=last, size=30),
            }
        )

    best = likelihood(20, 6, 49)
    assert all(best > likelihood(unstable, 6, 49) for unstable in (0, 10, 30, 50))
    assert all(best > likelihood(20, size, 49) for size in (3, 4, 5, 7, 9))
    assert all(best > likelihood(20, 6, last) for last in (0, 25, 40))
    assert exp(best) < 1.0


def test_means_are_compared_by_the_studentized_range():
    rng = np.random.default_rng(0)
    groups = {prune: rng.normal(15.0 - 15.0 * prune, 12.0, 50) for prune in PROBABILITIES}
    found = compare_means(groups)
    assert list(found) == list(TABLE_A3)
    within = np.mean([group.var(ddof=1) for group in groups.values()])
    critical = stats.studentized_range.ppf(0.95, 5, 245) * np.sqrt(within / 50)
    for (one, other), row in found.items():
        assert row.difference == pytest.approx(groups[other].mean() - groups[one].mean())
        assert row.rejected == (abs(row.difference) > critical)
    assert {row.rejected for row in found.values()} == {True, False}


# Section.


def test_the_section_compares_counts_decisions_and_directions():
    options = ReproductionOptions(runs=10)
    counts = {("s1", 0.0): 4, ("s2", 0.0): 10}
    results = make_results(options, lambda system, prune: counts.get((system, prune), 0))
    section = summarise(results, options)
    tables = {table.title: table for table in section.tables}
    first = tables["Counts and sizes in the text of Appendix A"].rows
    assert len(first) == len(PUBLISHED)
    assert first[0][:3] == ("S1, PRPB 0, unstable", "20 of 50", "4 of 10 (95 %: 12 to 74 %)")
    low, high = expected_counts(4, 10)
    assert first[0][3] == f"agrees: 50 runs like those here have {low} to {high} (95 %)"
    assert all("opposite" not in row[-1] for row in tables["Directions in the text of Appendix A"].rows)
    tukey = next(table for title, table in tables.items() if title.startswith("Table A.3"))
    assert [row[2] == "different" for row in tukey.rows] == [rejected for _, rejected in TABLE_A3.values()]
    assert {row[-1] for row in tukey.rows} == {"the same decision", "another decision"}
    scan = next(table for title, table in tables.items() if title.startswith("Scan"))
    assert [float(row[0]) for row in scan.rows] == list(VARIANCES)
    assert len(section.document["tukey"]) == 20
    assert any("-15.07 between PRPB 0 and 1" in paragraph for paragraph in section.introduction)
    assert all(cell["simulation"].count(None) == cell["unstable"] for cell in section.document["cells"])


def test_a_variance_that_only_table_a3_needs_is_named():
    options = ReproductionOptions(runs=10)
    results = make_results(options)
    for key, result in results.items():
        if key.startswith(f"appendix-a-s2-{SOFT_VARIANCE:g}-"):
            for run in result["runs"]:
                run["prediction"] = 1.0 + 0.1 * run["seed"]  # equal means
    text = " ".join(summarise(results, options).introduction)
    assert f"Table A.3 thus needs a variance near {STATED_VARIANCE:g}" in text
    assert "Table A.3 thus needs" not in " ".join(summarise(make_results(options), options).introduction)


def test_a_count_that_differs_names_the_variances_at_which_it_agrees():
    options = ReproductionOptions(runs=10)
    results = make_results(options)
    for seed, run in enumerate(results[f"appendix-a-s1-{VARIANCES[0]:g}-0-0"]["runs"]):
        run["simulation"] = None if seed < 4 else 1.0
    row = summarise(results, options).tables[0].rows[0]
    assert row[3].startswith("differs: 50 runs like those here have 0 to ")
    assert row[3].endswith(f"(95 %); in the scan it agrees at the variance {VARIANCES[0]:g}")


@pytest.mark.parametrize("quick", [True, False])
def test_figures_are_drawn_in_both_themes(quick):
    options = ReproductionOptions(runs=3, quick=quick)
    section = summarise(make_results(options, lambda _system, prune: 1 if prune == 0 else 0), options)
    assert [figure.name for figure in section.figures] == ["figure-a7", "appendix-a-scan"][: 2 - quick]
    assert ("short form" in " ".join(section.introduction)) is quick
    for figure in section.figures:
        backgrounds = {figure.draw(theme).get_facecolor() for theme in THEMES}
        assert len(backgrounds) == len(THEMES)


def test_runs_are_read_as_they_were_stored():
    options = ReproductionOptions(runs=7)
    cells = read_runs(make_results(options, lambda _system, _prune: 2), options)
    runs = cells["s1", SOFT_VARIANCE, 0.0]
    assert [run.seed for run in runs] == list(range(7))
    assert [run.unstable for run in runs] == [True, True, *5 * [False]]
