"""Properties of emigration: selection policies and schedule."""

from dataclasses import replace
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import Island, empty_archipelago
from islands.evolution.engine import SerialEngine, select_migrants
from islands.evolution.generation import select_elite
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.migration import SELECTION_POLICIES
from islands.evolution.problem import Problem
from islands.evolution.rng import Purpose, Stream
from support.migrations import (
    SETTINGS,
    every_selection_policy,
    islands,
    keys,
    models,
    never_stop,
    recorded,
    sample_individuals,
)
from support.searches import SMALL


@every_selection_policy
@given(islands(), st.integers(0, 5))
def test_emigrants_are_distinct_elite_members_with_a_known_fitness(policy, island, count):
    setting = replace(SETTINGS, emigrants=policy, migrants=count, migrate_every=1)
    emigrants = select_migrants(replace(island, generation=4), setting)
    assert len(emigrants) <= count
    assert all(isfinite(each.fitness) for each in emigrants)
    assert len(set(keys(emigrants))) == len(emigrants)
    assert all(each in island.elite for each in emigrants)


@every_selection_policy
def test_number_of_emigrants_follows_the_schedule(policy):
    sizes = {each.size: each for each in sorted(models(), key=lambda each: (-each.size, -each.fitness))}
    # Every larger model is fitter, so all are on the front.
    population = tuple(replace(each, fitness=1.0 / size) for size, each in sizes.items())
    assert len(population) > 3
    island = Island(0, 3, 0, population, population, with_entries(HallOfFame(), population))
    setting = replace(SETTINGS, emigrants=policy, migrants="2,9:0,12:3", migrate_every=1)
    counted = [len(select_migrants(replace(island, generation=each), setting)) for each in (8, 9, 11, 12, 99)]
    assert counted == [2, 0, 0, 3, 3]
    many = replace(setting, population=1000, migrants=1000)
    assert len(select_migrants(replace(island, generation=8), many)) == len(population)


@given(islands(), st.integers(1, 5))
def test_best_policy_selects_the_fittest(island, count):
    emigrants = SELECTION_POLICIES["best"](island.elite, count, Stream(0, 0, 0, Purpose.EMIGRATION))
    fitness = {each.key: each.fitness for each in island.elite if isfinite(each.fitness)}
    assert [each.fitness for each in emigrants] == sorted(fitness.values())[:count]


def pareto_reference(elite):
    """Return the non-dominated members of the elite, the first of equals."""
    size_and_fitness = {
        each.key: (each.size, each.fitness) for each in reversed(elite) if isfinite(each.fitness)
    }
    dominated = {
        own
        for own in size_and_fitness.values()
        if any(
            size <= own[0] and error <= own[1] and (size, error) != own
            for size, error in size_and_fitness.values()
        )
    }
    first = {(each.size, each.fitness): each for each in reversed(elite)}
    return [first[own] for own in dict.fromkeys(size_and_fitness.values()) if own not in dominated]


@given(st.data())
def test_front_policy_selects_the_pareto_front(data):
    one = st.tuples(st.sampled_from(sample_individuals()), st.sampled_from([None, 0.5, 1.0, 2.0]))
    drawn = data.draw(st.lists(one, max_size=30))
    population = {
        each.key: replace(each, fitness=error) if error and isfinite(each.fitness) else each
        for each, error in drawn
    }
    elite = select_elite(population.values(), 20, False)
    emigrants = SELECTION_POLICIES["front"](elite, len(elite), Stream(0, 0, 0, Purpose.EMIGRATION))
    assert sorted(map(id, emigrants)) == sorted(map(id, pareto_reference(elite)))


@pytest.mark.parametrize("policy", ["random", "front"])
def test_random_policies_select_every_member_of_their_pool(policy):
    elite = select_elite(models(), len(models()), True)
    elite = (*pareto_reference(elite), *elite[:10])
    pool = {"random": elite, "front": pareto_reference(elite)}[policy]
    assert len(pool) >= 3
    setting = replace(SETTINGS, emigrants=policy, migrants=1, migrate_every=1)
    everywhere = [
        select_migrants(Island(index, seed, generation, (), elite, HallOfFame()), setting)[0]
        for index in range(6)
        for seed in range(6)
        for generation in range(1, 7)
    ]
    assert set(keys(everywhere)) == set(keys(pool))


@pytest.mark.ci
def test_long_search_with_front_policy_has_only_valid_genes():
    """The evaluator raises an error for genes that exceed the maximum lag."""
    setting = replace(
        SMALL,
        emigrants="front",
        islands=4,
        topology="fully-connected",
        migrate_every=2,
        migrants=3,
        generations=40,
    )
    for epoch in SerialEngine().run(Problem(recorded(), setting), empty_archipelago(4, 2), never_stop):
        last = epoch.archipelago
    assert last.generation == 40
