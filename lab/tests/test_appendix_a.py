"""Appendix A: runs, published numbers, the likelihood of a scan, Tukey's test and the section."""

from math import exp, inf, log

import numpy as np
import pytest
from scipy import stats

from islands.evolution.presets import PRESETS
from islands.facade.identify import identify
from islands.systems import appendix
from lab.reproduction import appendix_a
from lab.reproduction.appendix_a import (
    PROBABILITIES,
    TABLE_A3,
    AppendixRun,
    compare_means,
    expected_counts,
    interval,
    log_likelihood,
    run_searches,
)


def make_runs(count, unstable=0, size=10, prediction=1.0):
    return [
        AppendixRun(seed, size, 0.1, prediction + 0.01 * seed, inf if seed < unstable else 2.0)
        for seed in range(count)
    ]


def test_table_a3_agrees_with_itself():
    """Differences of means add up, and equality is rejected if the interval excludes zero (Table A.3)."""
    for (one, other), (difference, rejected) in TABLE_A3.items():
        assert rejected == (abs(difference) > 6.7601)
        if one > 0.0:
            assert TABLE_A3[0.0, other][0] - TABLE_A3[0.0, one][0] == pytest.approx(difference, abs=2e-4)
    assert sum(rejected for _, rejected in TABLE_A3.values()) == 5


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
