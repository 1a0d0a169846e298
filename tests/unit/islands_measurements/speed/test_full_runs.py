"""Timed searches evaluate the same individuals as a search and count them."""

from dataclasses import replace

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.problem import Problem
from islands_measurements.speed.full_runs import Run, run_in_processes, run_island
from islands_measurements.speed.workload import ISLAND, benchmark_record

SMALL = replace(ISLAND, population=10, generations=3)


@pytest.fixture(scope="module")
def piezo():
    return benchmark_record(2_000)


def test_two_islands_have_the_papers_population():
    assert (ISLAND.population, ISLAND.generations) == (250, 500)


def test_timed_search_evaluates_the_individuals_of_the_engine(piezo):
    fractions = []
    found = run_island(piezo, SMALL, 0, fractions.append)
    epochs = SerialEngine().run(Problem(piezo, SMALL), empty_archipelago(1, 0), lambda: False)
    assert found.evaluations == sum(info.evaluations for epoch in epochs for info in epoch.steps[0]) == 40
    assert fractions == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert 0.0 < found.evaluating_cpu_s < found.cpu_s
    assert found.wall_s > 0.0
    assert all(size > 0 for size in found.caches.values())
    assert found.caches


def test_duplicates_are_offspring_with_a_known_structure(piezo):
    """The duplicates of a benchmark differ from those that an island reports.

    Abandoned individuals that are evaluated to the end are not offspring.
    """

    class Counting(Evaluator):
        offspring = others = 0

        def evaluate_genes(self, individuals, pruned, thresholds=None):
            found, known = super().evaluate_genes(individuals, pruned, thresholds)
            self.offspring += known if thresholds is not None else 0
            self.others += known if thresholds is None else 0
            return found, known

    # In tournaments of size one abandoned individuals win as well, some of them repeatedly.
    setting = replace(
        SMALL, population=60, generations=12, tournament=1, constraints="none", structure="free"
    )
    evaluator = Counting(piezo, setting)
    island, info = first_generation(0, 0, evaluator)
    reported = info.duplicates
    while island.generation < setting.generations:
        island, info = step(island, evaluator)
        reported += info.duplicates
    assert evaluator.others > 0
    found = run_island(piezo, setting, 0)
    assert found.duplicates == evaluator.offspring != reported
    assert found.evaluations == 13 * 60


def test_rates_are_counts_over_times():
    run = Run(
        evaluations=1000, duplicates=200, cpu_s=2.0, wall_s=4.0, evaluating_cpu_s=1.6, caches={"bytes": 1}
    )
    assert run.per_cpu_second == 500.0
    assert run.per_second == 250.0
    # Duplicates are not evaluated: they do not count for the kernels.
    assert run.amortised_ms == 2.0


@pytest.mark.nightly
@pytest.mark.parametrize("warm", [False, True])
def test_separate_processes_run_the_same_searches(piezo, warm):
    seconds, runs = run_in_processes(piezo, SMALL, [0, 1], warm)
    here = [run_island(piezo, SMALL, index) for index in (0, 1)]
    assert [(run.evaluations, run.duplicates) for run in runs] == [
        (run.evaluations, run.duplicates) for run in here
    ]
    assert seconds > max(run.wall_s for run in runs)
