"""Laws of emigration: who leaves an island, and when."""

from dataclasses import replace
from itertools import chain
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.epoch import select_migrants
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.island import Island, select_elite
from islands.evolution.migration.policies import SELECTION_POLICIES
from islands.evolution.problem import Problem
from islands.model.expression import Apply, Lagged, height, walk
from islands.simulation.outcome import Status
from support.migrations import SETTINGS, every_emigrants, folk, islands, keys, models, never, recorded
from support.searches import SMALL, islands_of


def test_the_folk_of_these_tests_are_of_all_sorts():
    verdicts = [each.outcome.verdict for each in folk()]
    assert verdicts.count(Status.OK) > 30
    assert verdicts.count(Status.ABANDONED) > 10
    assert len(set(verdicts)) > 2


@every_emigrants
@given(islands(), st.integers(0, 5))
def test_emigrants_are_members_with_a_known_fitness_each_structure_once(leave, island, count):
    setting = replace(SETTINGS, emigrants=leave, migrants=count, migrate_every=1)
    leaving = select_migrants(replace(island, generation=4), setting)
    assert len(leaving) <= count
    assert all(isfinite(each.fitness) for each in leaving)
    assert len(set(keys(leaving))) == len(leaving)
    assert all(each in island.elite for each in leaving)


@every_emigrants
@given(islands())
def test_nobody_leaves_but_at_a_stop(leave, island):
    setting = replace(SETTINGS, emigrants=leave, migrate_every="3,8:2", elite=1.0)
    island = replace(island, elite=(models()[0],), hall_of_fame=with_entries(HallOfFame(), models()[:1]))
    leaving = [
        len(select_migrants(replace(island, generation=generation), setting)) for generation in range(-1, 13)
    ]
    assert leaving == [int(generation in (3, 6, 8, 10, 12)) for generation in range(-1, 13)]


@every_emigrants
def test_as_many_leave_as_the_schedule_says(leave):
    sizes = {each.size: each for each in sorted(models(), key=lambda each: (-each.size, -each.fitness))}
    # Every larger model is fitter: all are on the front.
    people = tuple(replace(each, fitness=1.0 / size) for size, each in sizes.items())
    assert len(people) > 3
    island = Island(0, 3, 0, people, people, with_entries(HallOfFame(), people))
    setting = replace(SETTINGS, emigrants=leave, migrants="2,9:0,12:3", migrate_every=1)
    counted = [len(select_migrants(replace(island, generation=each), setting)) for each in (8, 9, 11, 12, 99)]
    assert counted == [2, 0, 0, 3, 3]
    many = replace(setting, population=1000, migrants=1000)
    assert len(select_migrants(replace(island, generation=8), many)) == len(people)


@given(islands(), st.integers(1, 5))
def test_the_best_leave_first(island, count):
    leaving = SELECTION_POLICIES["best"](island.elite, count, Stream(0, 0, 0, Purpose.EMIGRATION))
    fitness = {each.key: each.fitness for each in island.elite if isfinite(each.fitness)}
    assert [each.fitness for each in leaving] == sorted(fitness.values())[:count]


@pytest.mark.parametrize("leave", ["best", "random"])
def test_of_two_that_are_one_model_the_first_leaves(leave):
    one = next(each for each in models() if each.size > 1)
    copy = replace(one, genes=one.genes[::-1])
    assert copy != one
    leaving = SELECTION_POLICIES[leave]((one, copy), 2, Stream(0, 0, 0, Purpose.EMIGRATION))
    assert leaving == (one,)


def front_of(elite):
    """Nobody of the elite is smaller and as fit, or fitter and as small; of equals the first."""
    worth = {each.key: (each.size, each.fitness) for each in reversed(elite) if isfinite(each.fitness)}
    beaten = {
        own
        for own in worth.values()
        if any(size <= own[0] and error <= own[1] and (size, error) != own for size, error in worth.values())
    }
    first = {(each.size, each.fitness): each for each in reversed(elite)}
    return [first[own] for own in dict.fromkeys(worth.values()) if own not in beaten]


@given(st.data())
def test_the_front_is_who_nobody_of_the_elite_beats_in_error_and_size(data):
    one = st.tuples(st.sampled_from(folk()), st.sampled_from([None, 0.5, 1.0, 2.0]))
    drawn = data.draw(st.lists(one, max_size=30))
    people = {
        each.key: replace(each, fitness=error) if error and isfinite(each.fitness) else each
        for each, error in drawn
    }
    elite = select_elite(people.values(), 20, False)
    leaving = SELECTION_POLICIES["front"](elite, len(elite), Stream(0, 0, 0, Purpose.EMIGRATION))
    assert sorted(map(id, leaving)) == sorted(map(id, front_of(elite)))


@pytest.mark.parametrize("leave", ["best", "random", "front"])
def test_whoever_is_in_the_hall_of_fame_alone_does_not_leave(leave):
    """Its genes are those that were estimated: variation could not breed from them."""
    small, *others = sorted(models(), key=lambda each: each.size)
    island = Island(0, 3, 4, (), tuple(others[-3:]), with_entries(HallOfFame(), [small, *others]))
    setting = replace(SETTINGS, emigrants=leave, migrants=3, migrate_every=1)
    assert set(keys(select_migrants(island, setting))) <= set(keys(others[-3:]))


@pytest.mark.parametrize("leave", ["random", "front"])
def test_anyone_may_leave_and_every_place_of_a_run_draws_others(leave):
    elite = select_elite(models(), len(models()), True)
    elite = (*front_of(elite), *elite[:10])
    pool = {"random": elite, "front": front_of(elite)}[leave]
    assert len(pool) > 3
    setting = replace(SETTINGS, emigrants=leave, migrants=1, migrate_every=1)
    everywhere = [
        select_migrants(Island(index, seed, generation, (), elite, HallOfFame()), setting)[0]
        for index in range(6)
        for seed in range(6)
        for generation in range(1, 7)
    ]
    assert set(keys(everywhere)) == set(keys(pool))


def test_the_draws_of_those_who_leave_know_island_generation_and_seed_and_are_their_own():
    elite = select_elite(models(), 20, True)
    setting = replace(SETTINGS, emigrants="random", migrants=6, migrate_every=1)
    island = Island(0, 3, 1, (), elite, HallOfFame())
    others = (replace(island, index=1), replace(island, generation=2), replace(island, seed=4))
    # 20 * 19 * .. * 15 orders: no two are the same by chance.
    assert len({select_migrants(each, setting) for each in (island, *others, island)}) == 4
    for purpose in Purpose:
        drawn = SELECTION_POLICIES["random"](elite, 6, Stream(3, 0, 1, purpose))
        assert (drawn == select_migrants(island, setting)) == (purpose is Purpose.EMIGRATION)


@pytest.mark.parametrize("structure", ["free", "phi"])
@every_emigrants
def test_whoever_leaves_is_made_of_what_the_settings_allow(leave, structure):
    """Variation relies on it: a leaf that reads farther than any of its own may be put under back-shifts."""
    setting = replace(SMALL, emigrants=leave, migrants=9, migrate_every=1, structure=structure)
    for island in islands_of(Evaluator(recorded(), setting), 4)[1:]:
        leaving = select_migrants(island, setting)
        assert leaving
        for gene in chain(*(each.genes for each in leaving)):
            assert height(gene) <= setting.max_height
            for node in walk(gene):
                assert not isinstance(node, Apply) or node.primitive.name in setting.primitives
                assert not isinstance(node, Lagged) or node.lag == 1


def test_a_long_search_breeds_from_the_front_without_a_gene_that_the_settings_forbid():
    """Genes that read farther than the settings let them are refused by the evaluator."""
    setting = replace(
        SMALL,
        emigrants="front",
        islands=4,
        topology="fully-connected",
        migrate_every=2,
        migrants=3,
        generations=40,
    )
    for epoch in SerialEngine().run(Problem(recorded(), setting), empty_archipelago(4, 2), never):
        last = epoch.archipelago
    assert last.generation == 40
