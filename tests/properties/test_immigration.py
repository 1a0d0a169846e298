"""Laws of immigration: who arrives on an island, and in whose place."""

from dataclasses import replace
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.epoch import receive_migrants, run_epoch
from islands.evolution.generation.evaluation import Evaluator, Limits
from islands.evolution.gp.individual import Individual
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.island import Island, select_elite
from islands.evolution.migration.policies import REPLACEMENT_POLICIES
from islands.evolution.migration.topology import topology
from islands.evolution.problem import Problem
from islands.simulation.outcome import Status
from support.migrations import (
    SETTINGS,
    arrivals,
    evaluator,
    every_replaced,
    islands,
    keys,
    known_fitness,
    models,
    never,
    recorded,
)
from support.searches import SMALL, exactly


def expected(island, arriving):
    """Those who arrive, in the order of the sources, and by the first of a structure."""
    immigrants = []
    for each in chain(*arriving):
        if each.key not in keys(island.elite) and each.key not in keys(immigrants):
            immigrants.append(each)
    return immigrants[: len(island.population)]


@pytest.mark.parametrize("distinct", [False, True])
@every_replaced
@given(st.data(), arrivals())
def test_migration_conserves_sizes_and_all_who_are_not_replaced(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = receive_migrants(island, arriving, evaluator(), setting)
    immigrants = expected(island, arriving)
    assert len(after.population) == len(island.population)
    fresh = [new for new, old in zip(after.population, island.population, strict=True) if new is not old]
    assert sorted(map(id, fresh)) == sorted(map(id, immigrants))
    assert replace(after, population=island.population, elite=island.elite) == island
    if not immigrants:
        assert exactly(after) == exactly(island)


@pytest.mark.parametrize("distinct", [False, True])
@every_replaced
@given(st.data(), arrivals())
def test_the_elite_is_the_best_of_itself_and_those_who_arrive(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = receive_migrants(island, arriving, evaluator(), setting)
    contenders = [*island.elite, *expected(island, arriving)]
    # Nobody who arrives has the structure of another contender: distinct elites stay so.
    assert [each.fitness for each in after.elite] == sorted(each.fitness for each in contenders)[
        : SETTINGS.elites
    ]
    assert after.elite == select_elite(contenders, SETTINGS.elites, distinct)
    if len(island.elite) == SETTINGS.elites:
        assert len(after.elite) == SETTINGS.elites


def test_who_is_known_in_the_elite_does_not_arrive_again():
    one, two, *others = models()
    population = tuple(others[: SETTINGS.population])
    island = Island(0, 3, 6, population, (one,), HallOfFame())
    assert receive_migrants(island, [(replace(one),), (replace(one),)], evaluator(), SETTINGS) == island
    # Who is known in the population alone does: there it may be bred away.
    after = receive_migrants(island, [(replace(one), replace(population[0]))], evaluator(), SETTINGS)
    assert one not in after.population
    assert population[0] in after.elite
    assert two in receive_migrants(island, [(two, one)], evaluator(), SETTINGS).population


@every_replaced
def test_of_one_structure_the_first_source_s_arrives_and_of_too_many_the_first_ones(replaced):
    one, two, three, *others = models()
    island = Island(0, 3, 6, tuple(others[:2]), (others[3],), HallOfFame())
    again = replace(one, genes=one.genes[::-1])
    setting = replace(SETTINGS, replaced=replaced)
    after = receive_migrants(island, [(), (one,), (again, two), (three,)], evaluator(), setting)
    assert {id(each) for each in after.population} == {id(one), id(two)}


@given(islands(), arrivals())
def test_the_worst_are_replaced_by_what_they_are_worth_the_abandoned_too(island, arriving):
    after = receive_migrants(island, arriving, evaluator(), replace(SETTINGS, replaced="worst"))
    fitness = [known_fitness(each.genes) for each in island.population]
    places = sorted(range(len(fitness)), key=lambda place: (-fitness[place], place))
    for place, each in zip(places, expected(island, arriving), strict=False):
        assert after.population[place] is each


def test_anyone_may_be_replaced_and_every_place_of_a_run_draws_others():
    newcomer, member, *others = models()
    island = Island(0, 3, 1, tuple(others[:6]), (member,), HallOfFame())
    setting = replace(SETTINGS, replaced="random")

    def place(**changes):
        after = receive_migrants(replace(island, **changes), [(newcomer,)], evaluator(), setting)
        return after.population.index(newcomer)

    for name in ("index", "generation", "seed"):
        assert {place(**{name: value}) for value in range(40)} == set(range(6)), name
    drawn = [place(generation=generation) for generation in range(20)]
    for purpose in Purpose:
        streams = [Stream(3, 0, generation, purpose) for generation in range(20)]
        own = [REPLACEMENT_POLICIES["random"](6, pytest.fail, 1, stream)[0] for stream in streams]
        assert (own == drawn) == (purpose is Purpose.IMMIGRATION)


@every_replaced
@given(islands(), arrivals())
def test_an_arrival_depends_on_nothing_that_an_evaluator_has_seen(replaced, island, arriving):
    setting = replace(SETTINGS, replaced=replaced)
    after = exactly(receive_migrants(island, arriving, evaluator(), setting))
    fresh = Evaluator(recorded(), SETTINGS)
    patient = Evaluator(recorded(), SETTINGS, Limits(pairs=0, genes=0, structures=0), abandon=False)
    barred = Evaluator(recorded(), SETTINGS)
    # It knows of everybody, but that they passed a bar.
    barred.evaluate([(Individual(each.genes), False) for each in island.population], [1e-9] * 9)
    for other in (fresh, patient, barred, fresh):
        assert exactly(receive_migrants(island, arriving, other, setting)) == after


def courses(setting, abandon, seed=5):
    """Every island's epochs, one after the other, and how many stood abandoned where somebody arrived."""
    posed, judge = Problem(recorded(), setting), Evaluator(recorded(), setting, abandon=abandon)
    sources = topology(setting.topology, setting.islands, seed).sources
    archipelago, leaving = empty_archipelago(setting.islands, seed).islands, [()] * setting.islands
    found, abandoned = [], 0
    while archipelago[0].generation < setting.generations:
        if any(leaving):
            everybody = chain(*(island.population for island in archipelago))
            abandoned += sum(each.outcome.verdict is Status.ABANDONED for each in everybody)
        epochs = [
            run_epoch(island, [leaving[source] for source in sources[island.index]], judge, posed, never)
            for island in archipelago
        ]
        archipelago, leaving = [epoch.island for epoch in epochs], [epoch.emigrants for epoch in epochs]
        found.append(epochs)
    return found, abandoned


@every_replaced
def test_a_run_with_migration_is_that_of_one_that_abandons_nobody(replaced):
    setting = replace(
        SMALL,
        islands=3,
        topology="bidirectional-ring",
        generations=8,
        migrate_every=2,
        migrants=3,
        replaced=replaced,
        characters=("plain", "explorer"),
    )
    (hasty, given_up), (patient, settled) = courses(setting, True), courses(setting, False)
    assert settled == 0
    # The law says nothing where nobody is given up.
    assert given_up > 10
    assert len(hasty) == 5
    for one, other in zip(chain(*hasty), chain(*patient), strict=True):
        assert repr(one.emigrants) == repr(other.emigrants)
        assert repr(one.island.hall_of_fame) == repr(other.island.hall_of_fame)
        assert repr(one.island.elite) == repr(other.island.elite)
        assert [each.genes for each in one.island.population] == [
            each.genes for each in other.island.population
        ]
