"""Properties of immigration: immigrants, replaced individuals and elite."""

from dataclasses import replace
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import Island, empty_archipelago
from islands.evolution.engine import receive_migrants, run_epoch
from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.generation import select_elite
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import Individual
from islands.evolution.migration import parse_topology
from islands.evolution.problem import GeneEvolution, Problem
from islands.simulation.outcome import Status
from support.migrations import (
    SETTINGS,
    arrivals,
    every_replacement_policy,
    evolution,
    islands,
    keys,
    known_fitness,
    models,
    never_stop,
    recorded,
)
from support.searches import SMALL, exactly

pytestmark = pytest.mark.ci


def expected(island, arriving):
    """Return the expected immigrants: the first of every new structure, in the order of the sources."""
    immigrants = []
    for each in chain(*arriving):
        if each.key not in keys(island.elite) and each.key not in keys(immigrants):
            immigrants.append(each)
    return immigrants[: len(island.population)]


@pytest.mark.parametrize("distinct", [False, True])
@every_replacement_policy
@given(st.data(), arrivals())
def test_immigration_conserves_sizes_and_individuals_not_replaced(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = receive_migrants(island, arriving, evolution(setting))
    immigrants = expected(island, arriving)
    assert len(after.population) == len(island.population)
    fresh = [new for new, old in zip(after.population, island.population, strict=True) if new is not old]
    assert sorted(map(id, fresh)) == sorted(map(id, immigrants))
    assert replace(after, population=island.population, elite=island.elite) == island
    if not immigrants:
        assert exactly(after) == exactly(island)


@pytest.mark.parametrize("distinct", [False, True])
@every_replacement_policy
@given(st.data(), arrivals())
def test_elite_is_the_best_of_elite_and_immigrants(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = receive_migrants(island, arriving, evolution(setting))
    contenders = [*island.elite, *expected(island, arriving)]
    # Immigrants have structures that differ from all contenders, so distinct elites stay distinct.
    ordered = sorted(each.fitness for each in contenders)
    if distinct:
        best = {each.niche: each.fitness for each in sorted(contenders, key=lambda each: -each.fitness)}
        first = sorted(best.values())[: SETTINGS.elites]
        for fitness in first:
            ordered.remove(fitness)
        ordered = sorted([*first, *ordered[: SETTINGS.elites - len(first)]])
    assert [each.fitness for each in after.elite] == ordered[: SETTINGS.elites]
    assert after.elite == select_elite(contenders, SETTINGS.elites, distinct)
    if len(island.elite) == SETTINGS.elites:
        assert len(after.elite) == SETTINGS.elites


def test_structures_in_the_elite_do_not_immigrate_again():
    one, two, *others = models()
    population = tuple(others[: SETTINGS.population])
    island = Island(0, 3, 6, population, (one,), HallOfFame())
    assert receive_migrants(island, [(replace(one),), (replace(one),)], evolution(SETTINGS)) == island
    # Structures that are only in the population do immigrate, because the population may lose them.
    after = receive_migrants(island, [(replace(one), replace(population[0]))], evolution(SETTINGS))
    assert one not in after.population
    assert population[0] in after.elite
    assert two in receive_migrants(island, [(two, one)], evolution(SETTINGS)).population


@given(islands(), arrivals())
def test_worst_policy_evaluates_abandoned_individuals(island, arriving):
    after = receive_migrants(island, arriving, evolution(replace(SETTINGS, replaced="worst")))
    fitness = [known_fitness(each.genes) for each in island.population]
    places = sorted(range(len(fitness)), key=lambda place: (-fitness[place], place))
    for place, each in zip(places, expected(island, arriving), strict=False):
        assert after.population[place] is each


@every_replacement_policy
@given(islands(), arrivals())
def test_immigration_does_not_depend_on_the_cache(replaced, island, arriving):
    setting = replace(SETTINGS, replaced=replaced)
    after = exactly(receive_migrants(island, arriving, evolution(setting)))
    fresh = Evaluator(recorded(), SETTINGS)
    complete = Evaluator(recorded(), SETTINGS, Limits(pairs=0, genes=0, structures=0), abandon=False)
    with_thresholds = Evaluator(recorded(), SETTINGS)
    # All individuals are cached as abandoned.
    with_thresholds.evaluate([(Individual(each.genes), False) for each in island.population], [1e-9] * 9)
    for other in (fresh, complete, with_thresholds, fresh):
        assert exactly(receive_migrants(island, arriving, evolution(setting, other))) == after


def run_epochs(setting, abandon, seed=5):
    """Return the epochs of all islands, and the number of abandoned individuals at immigrations."""
    search_problem, own_evaluator = (
        Problem(recorded(), setting),
        Evaluator(recorded(), setting, abandon=abandon),
    )
    sources = parse_topology(setting.topology, setting.islands, seed).sources
    archipelago, leaving = empty_archipelago(setting.islands, seed).islands, [()] * setting.islands
    found, abandoned = [], 0
    while archipelago[0].generation < setting.generations:
        if any(leaving):
            individuals = chain(*(island.population for island in archipelago))
            abandoned += sum(each.outcome.verdict is Status.ABANDONED for each in individuals)
        epochs = [
            run_epoch(
                island,
                [leaving[source] for source in sources[island.index]],
                GeneEvolution(search_problem, own_evaluator),
                never_stop,
            )
            for island in archipelago
        ]
        archipelago, leaving = [epoch.island for epoch in epochs], [epoch.emigrants for epoch in epochs]
        found.append(epochs)
    return found, abandoned


@every_replacement_policy
def test_abandonment_does_not_change_a_run_with_migration(replaced):
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
    (abandoning, abandoned), (complete, abandoned_in_complete) = (
        run_epochs(setting, True),
        run_epochs(setting, False),
    )
    assert abandoned_in_complete == 0
    # The test is meaningful only if individuals are abandoned.
    assert abandoned > 10
    assert len(abandoning) == 5
    for one, other in zip(chain(*abandoning), chain(*complete), strict=True):
        assert repr(one.emigrants) == repr(other.emigrants)
        assert repr(one.island.hall_of_fame) == repr(other.island.hall_of_fame)
        assert repr(one.island.elite) == repr(other.island.elite)
        assert [each.genes for each in one.island.population] == [
            each.genes for each in other.island.population
        ]
