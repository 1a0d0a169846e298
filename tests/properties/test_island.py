"""Properties of an island: steps are pure functions, and the elite never gets worse."""

import hashlib
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from itertools import pairwise
from math import inf
from pathlib import Path

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import unique_niches
from islands.evolution.problem import make_problem
from islands.evolution.rng import Purpose, Stream
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged
from islands.persistence.checkpoints import write_checkpoint
from support.repository import ROOT
from support.searches import SMALL, evolved, exactly, islands_of, record
from support.variation import breed_compiled, find_structure


def digest():
    """Return the hash of a checkpoint after ten generations of two islands with migration."""
    library = {"library": "phi-polynomial", "library_degree": 3, "from_library": 0.5}
    migration = {"migrate_every": 3, "migrants": 2, "emigrants": "front", "replaced": "random"}
    setting = replace(
        SMALL, structure="increment", characters=("plain", "recombiner"), **library, **migration
    )
    for epoch in SerialEngine().run(make_problem(record(), setting), empty_archipelago(2, 11), lambda: False):
        last = epoch.archipelago
    assert last.generation == 10
    with tempfile.TemporaryDirectory() as folder:
        write_checkpoint(last, Path(folder) / "checkpoint.json", {})
        return hashlib.sha256((Path(folder) / "checkpoint.json").read_bytes()).hexdigest()


# An individual recombines or mutates, never both.


def test_copies_that_were_not_pruned_remain_so_if_the_settings_say_so():
    changes = {"crossover": 0.0, "mutation": 0.0, "tolerance": 0.01, "constraints": "none"}
    for prune_copies in (True, False):
        evaluator = Evaluator(record(), replace(SMALL, prune=0.0, prune_copies=prune_copies, **changes))
        island, _ = first_generation(0, 1, evaluator)
        following, _ = step(island, evaluator, settings=replace(evaluator.settings, prune=1.0))
        copies = {each.key for each in following.population}
        assert (copies <= {each.key for each in island.population}) is not prune_copies


# Steps are pure functions.


def test_step_is_a_pure_function():
    evaluator = Evaluator(record(), SMALL)
    island, _ = first_generation(0, 3, evaluator)
    first, second = step(island, evaluator), step(island, evaluator)
    assert first[0] == second[0]
    assert first[0] == step(island, Evaluator(record(), SMALL))[0]
    assert first[0] != island
    assert first[0].generation == 1


def test_settings_of_an_island_override_those_of_the_evaluator():
    """The settings and the cache of a shared evaluator have no effect."""
    profile_settings = replace(SMALL, crossover=0.3, mutation=1.0, tournament=2, prune=0.7, population=30)
    shared, alike = Evaluator(record(), SMALL), Evaluator(record(), profile_settings)
    here, there = first_generation(0, 3, shared, (), profile_settings), first_generation(0, 3, alike)
    for _ in range(3):
        assert exactly(here) == exactly(there)
        here, there = step(here[0], shared, (), profile_settings), step(there[0], alike)
    assert len(here[0].population) == 30
    assert step(here[0], shared)[0] != step(here[0], shared, (), profile_settings)[0]


def test_ten_generations_give_equal_bits_twice():
    assert digest() == digest()


# Statistics of a step.


@pytest.mark.ci
def test_ten_generations_give_equal_bits_in_other_processes():
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


def test_random_streams_depend_on_island_and_generation():
    """Selection, variation and pruning differ between islands and between generations."""
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


def test_parents_are_elite_and_offspring():
    evaluator = Evaluator(record(), replace(SMALL, prune=0.0, crossover=0.0, mutation=0.0, distinct=True))
    island = evolved(0, evaluator.settings, evaluator=evaluator)
    best, others = island.elite[:1], island.population[1:]
    only_in_elite = replace(island, elite=best, population=tuple(each for each in others if each != best[0]))
    following, info = step(only_in_elite, evaluator)
    assert best[0] in following.population
    # All offspring are copies of parents.
    assert info.duplicates == len(following.population)
    assert len(set(following.population)) > 3


def test_hall_of_fame_keeps_models_that_the_population_has_lost():
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


def test_seeds_are_repaired_and_truncated():
    setting = replace(SMALL, prune=0.0, max_terms=3, initial_terms=(1, 3))
    given_seeds = [
        (parse("phi1(y(k-1), q1(u(k-1)))"),),
        tuple(parse(f"phi1(u(k-1), u(k-{lag}))") for lag in (2, 3, 4, 5)),
    ]
    island, _ = first_generation(0, 1, Evaluator(record(), setting), given_seeds)
    assert island.population[0].genes == (Lagged(0), parse("phi1(u(k-1), q1(u(k-1)))"))
    assert island.population[1].genes == (Lagged(0), *given_seeds[1][:2])


@pytest.mark.parametrize("distinct", [False, True])
def test_elite_is_the_best_of_previous_elite_and_offspring(distinct):
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
            worst = before.elite[-1].fitness if len(before.elite) == setting.elites else inf
            contenders = sorted((each.fitness, each.niche) for each in union if each.fitness <= worst)
            best = {niche: fitness for fitness, niche in reversed(contenders)}
            assert [each.fitness for each in unique_niches(island.elite)] == sorted(best.values())[
                : len(fitness)
            ]
        else:
            assert len(island.elite) == 6
            assert fitness == sorted(each.fitness for each in union)[: len(fitness)]
        assert len(island.population) == setting.population


@pytest.mark.parametrize("crossover", [0.0, 1.0])
def test_bred_children_differ_from_their_parents(crossover):
    """A single attempt gives a quarter of children with the structure of a parent, several a twentieth."""
    setting = replace(SMALL, crossover=crossover, mutation=1.0, prune=0.0, max_terms=5)
    evaluator = Evaluator(record(), setting)
    same = bred = 0
    for seed in range(6):
        island = islands_of(evaluator, 3, seed)[-1]
        rng = Stream(seed, 0, 4, Purpose.VARIATION)
        parents = [each.genes for couple in pairwise(island.population) for each in couple]
        children = breed_compiled(parents, setting, 1, rng)
        for place, genes in enumerate(children):
            first = place - place % 2
            known = {find_structure(each, setting) for each in parents[first : first + 2]}
            bred += 1
            same += find_structure(genes, setting) in known
    assert same < 0.1 * bred
