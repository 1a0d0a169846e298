"""Laws of an island: its steps are pure, its elite does not get worse, failures never lead."""

import hashlib
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from math import inf, isfinite, nan
from pathlib import Path

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual, make_regressor
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.island import first_generation, select_elite, step
from islands.evolution.problem import problem
from islands.io.checkpoints import write_checkpoint
from islands.model.expression import Lagged
from islands.model.parsing import parse
from support.repository import ROOT
from support.searches import SMALL, distinct_genes, evolved, exactly, islands_of, record


def digest():
    """The hash of a checkpoint after ten generations of two islands that send each other individuals."""
    library = {"library": "phi-polynomial", "library_degree": 3, "from_library": 0.5}
    migration = {"migrate_every": 3, "migrants": 2, "emigrants": "front", "replaced": "random"}
    setting = replace(
        SMALL, structure="increment", characters=("plain", "recombiner"), **library, **migration
    )
    for epoch in SerialEngine().run(problem(record(), setting), empty_archipelago(2, 11), lambda: False):
        last = epoch.archipelago
    assert last.generation == 10
    with tempfile.TemporaryDirectory() as folder:
        write_checkpoint(last, Path(folder) / "checkpoint.json", {})
        return hashlib.sha256((Path(folder) / "checkpoint.json").read_bytes()).hexdigest()


# An individual recombines or mutates, never both.


def bred(**changes):
    setting = replace(SMALL, prune=0.0, constraints="none", structure="free", **changes)
    evaluator = Evaluator(record(), setting)
    island, _ = first_generation(0, 1, evaluator)
    following, _ = step(island, evaluator)
    return island, following


def test_who_recombined_does_not_mutate():
    """Every pair recombines by whole genes; a mutation, as sure as can be, would bring in new ones."""
    island, following = bred(crossover=1.0, high_level=1.0, mutation=1.0, outer=1.0)
    known = {gene for each in island.population for gene in each.genes}
    assert {gene for each in following.population for gene in each.genes} <= known
    assert [each.genes for each in following.population] != [each.genes for each in island.population]


def test_who_did_not_recombine_mutates_in_one_gene():
    island, following = bred(crossover=0.0, mutation=1.0, outer=1.0)
    known = {gene for each in island.population for gene in each.genes}
    fresh = [sum(gene not in known for gene in each.genes) for each in following.population]
    assert max(fresh) == 1
    assert sum(fresh) > len(fresh) / 2


def test_who_neither_recombines_nor_mutates_is_a_copy():
    island, following = bred(crossover=0.0, mutation=0.0)
    assert set(following.population) <= set(island.population)


# The same island steps to the same island.


def test_a_step_twice_gives_the_same_island():
    evaluator = Evaluator(record(), SMALL)
    island, _ = first_generation(0, 3, evaluator)
    first, second = step(island, evaluator), step(island, evaluator)
    assert first[0] == second[0]
    assert first[0] == step(island, Evaluator(record(), SMALL))[0]
    assert first[0] != island
    assert first[0].generation == 1


def test_an_island_that_breeds_in_its_own_way_is_one_whose_settings_all_breed_like_it():
    """What another island's evaluator knows, and the settings it was made for, change nothing."""
    own = replace(SMALL, crossover=0.3, mutation=1.0, tournament=2, prune=0.7, population=30)
    shared, alike = Evaluator(record(), SMALL), Evaluator(record(), own)
    here, there = first_generation(0, 3, shared, (), own), first_generation(0, 3, alike)
    for _ in range(3):
        assert exactly(here) == exactly(there)
        here, there = step(here[0], shared, (), own), step(there[0], alike)
    assert len(here[0].population) == 30
    assert step(here[0], shared)[0] != step(here[0], shared, (), own)[0]


# What is told of a step.


def structures(population):
    return [each.key for each in population]


@pytest.mark.parametrize("initial_terms", [(1, 1), (1, 4)])
def test_a_duplicate_is_who_has_the_structure_of_a_parent_or_of_an_earlier_sibling(initial_terms):
    evaluator = Evaluator(record(), replace(SMALL, initial_terms=initial_terms))
    island, info = first_generation(0, 3, evaluator)
    parents, counted = [], []
    for _ in range(6):
        known, expected = set(parents), 0
        for structure in structures(island.population):
            expected += structure in known
            known.add(structure)
        counted.append(expected)
        assert (info.generation, info.duplicates) == (island.generation, expected)
        parents = structures((*island.elite, *island.population))
        island, info = step(island, evaluator)
    assert min(counted) > 0
    assert max(counted) < len(island.population)


def test_what_is_told_of_a_step_follows_from_the_island_alone():
    """An evaluator that has seen it all, and one that has seen nothing, as after a resume."""
    warm = Evaluator(record(), SMALL)
    islands = islands_of(warm, 4)
    for island in islands[:-1]:
        assert step(island, warm)[1] == step(island, Evaluator(record(), SMALL))[1]


def test_ten_generations_give_the_same_bits_twice():
    assert digest() == digest()


@pytest.mark.ci
def test_ten_generations_give_the_same_bits_in_other_processes():
    command = "import runpy, sys; print(runpy.run_path(sys.argv[1])['digest']())"
    running = [
        subprocess.Popen(
            [sys.executable, "-c", command, __file__],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(ROOT / "tests")},
        )
        for hash_seed in ("1", "2")
    ]
    assert [process.communicate(timeout=120)[0].strip() for process in running] == [digest()] * 2


def test_runs_of_other_seeds_differ():
    assert evolved(2, seed=3) != replace(evolved(2, seed=4), seed=3)


def test_every_stream_of_a_step_knows_its_island_and_its_generation():
    """Where all else is equal, other islands and other generations select, vary and prune otherwise."""
    for one_parent, changes in (
        (False, {"prune": 0.0, "crossover": 0.0, "mutation": 0.0}),
        (True, {"prune": 0.0, "crossover": 0.0, "mutation": 1.0}),
        (True, {"prune": 0.5, "crossover": 0.0, "mutation": 0.0, "tolerance": 0.01}),
    ):
        evaluator = Evaluator(record(), replace(SMALL, **changes))
        island = evolved(0, evaluator.settings, evaluator=evaluator)
        if one_parent:
            largest = max(island.population, key=lambda each: each.size)
            island = replace(island, population=(largest,), elite=(largest,))
        following = {
            step(replace(island, index=index, generation=generation), evaluator)[0].population
            for index in (0, 1)
            for generation in (0, 1)
        }
        assert len(following) == 4, changes


def test_parents_are_elite_and_offspring_together():
    evaluator = Evaluator(record(), replace(SMALL, prune=0.0, crossover=0.0, mutation=0.0, distinct=True))
    island = evolved(0, evaluator.settings, evaluator=evaluator)
    best, others = island.elite[:1], island.population[1:]
    only_in_elite = replace(island, elite=best, population=tuple(each for each in others if each != best[0]))
    following, info = step(only_in_elite, evaluator)
    assert best[0] in following.population
    # Copies of parents, whichever half of them these come from.
    assert info.duplicates == len(following.population)
    assert len(set(following.population)) > 3


def test_the_hall_of_an_island_remembers_what_its_population_has_lost():
    evaluator = Evaluator(record(), SMALL)
    island, _ = first_generation(0, 3, evaluator)
    expected = with_entries(HallOfFame(), island.population)
    for _ in range(4):
        assert island.hall_of_fame == expected
        island, _ = step(island, evaluator)
        expected = with_entries(expected, island.population)
    alive = {each.key for each in island.population}
    assert any(entry.key not in alive for entry in island.hall_of_fame.entries)


# Seeds, elites, failures.


def test_the_first_population_begins_with_the_seeds():
    setting = replace(SMALL, prune=0.0, library="phi-polynomial", library_degree=3, library_lags=3)
    posed = problem(record(), setting)
    assert [len(genes) for genes in posed.seeds] == sorted(len(genes) for genes in posed.seeds)
    assert len(posed.seeds) > 2
    island, _ = first_generation(0, 1, Evaluator(posed.record, setting), posed.seeds)
    for each, genes in zip(island.population, posed.seeds, strict=False):
        assert each.genes == genes
        assert set(each.regressors) == set(distinct_genes(genes))
    unseeded, _ = first_generation(0, 1, Evaluator(posed.record, setting))
    assert island.population[len(posed.seeds) :] == unseeded.population[: -len(posed.seeds)]


def test_seeds_are_mended_and_cut_like_everybody():
    setting = replace(SMALL, prune=0.0, max_terms=3, initial_terms=(1, 3))
    given_seeds = [
        (parse("phi1(y(k-1), q1(u(k-1)))"),),
        tuple(parse(f"phi1(u(k-1), u(k-{lag}))") for lag in (2, 3, 4, 5)),
    ]
    island, _ = first_generation(0, 1, Evaluator(record(), setting), given_seeds)
    assert island.population[0].genes == (Lagged(0), parse("phi1(u(k-1), q1(u(k-1)))"))
    assert island.population[1].genes == (Lagged(0), *given_seeds[1][:2])


def test_more_seeds_than_the_population_are_cut():
    setting = replace(SMALL, population=2)
    given_seeds = [(Lagged(0), parse(f"phi1(u(k-1), u(k-{lag}))")) for lag in (2, 3, 4)]
    island, _ = first_generation(0, 1, Evaluator(record(), setting), given_seeds)
    assert [each.genes for each in island.population] == given_seeds[:2]


@pytest.mark.parametrize("distinct", [False, True])
def test_the_elite_is_the_best_of_old_elite_and_offspring(distinct):
    setting = replace(SMALL, distinct=distinct, elite=0.25)
    evaluator = Evaluator(record(), setting)
    island, _ = first_generation(0, 3, evaluator)
    for _ in range(8):
        before = island
        island, _ = step(island, evaluator)
        fitness = [each.fitness for each in island.elite]
        assert fitness == sorted(fitness)
        assert fitness[0] <= before.elite[0].fitness
        union = (*before.elite, *island.population)
        if distinct:
            assert len({each.key for each in island.elite}) == len(island.elite)
            best = sorted({each.key: each.fitness for each in union}.values())
        else:
            assert len(island.elite) == 6
            best = sorted(each.fitness for each in union)
        assert fitness == best[: len(fitness)]
        assert len(island.population) == setting.population


def test_ties_for_the_elite_go_to_the_smaller_then_to_the_structure_s_text():
    def each(*texts):
        regressors = tuple(make_regressor(parse(text)) for text in texts)
        return Individual(tuple(map(parse, texts)), regressors, (1.0,) * len(texts), 0.5)

    large, late, early = each("y(k-1)", "u(k-1)"), each("y(k-3)"), each("y(k-2)")
    assert select_elite((large, late, early), 3, False) == (early, late, large)
    assert select_elite((large, late, early, early), 2, False) == (early, early)
    assert select_elite((large, late, early, early), 2, True) == (early, late)


def finite(fitness, text="y(k-1)"):
    return Individual((parse(text),), (make_regressor(parse(text)),), (1.0,), fitness)


def test_a_failure_never_enters_the_hall_of_fame_and_is_last_in_anelite_of():
    failures = [finite(value, text) for value, text in ((nan, "y(k-2)"), (inf, "y(k-3)"))]
    good = finite(5.0)
    assert with_entries(HallOfFame(), failures) == HallOfFame()
    assert with_entries(HallOfFame(), [*failures, good]).entries == (good,)
    # A record on which the only structures diverge: nothing enters, and the run goes on.
    setting = replace(
        SMALL, constraints="none", structure="free", primitives=("cube", "exp"), initial_height=4
    )
    island = evolved(1, setting, evaluator=Evaluator(record(), setting))
    assert {each.outcome.verdict.name for each in island.population} >= {"OK", "DIVERGED"}
    assert all(isfinite(entry.fitness) for entry in island.hall_of_fame.entries)
    assert isfinite(island.elite[0].fitness)
