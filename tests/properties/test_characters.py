"""Properties of island profiles: they change only variation and selection."""

from dataclasses import replace
from math import inf

import pytest

from islands.evolution.archipelago import Island
from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import Individual
from islands.evolution.problem import Problem
from islands.evolution.settings import ISLAND_PROFILES
from support.migrations import (
    SETTINGS,
    evaluator,
    models,
    recorded,
    run_next_epoch,
)
from support.searches import exactly, islands_of

pytestmark = pytest.mark.ci

every_profile = pytest.mark.parametrize("profile", ISLAND_PROFILES)

#: Settings that a profile may change. None of them affects the model or fitness of an individual.
BREEDING = {"crossover", "mutation", "prune", "tournament", "high_level", "outer", "from_library"}


@every_profile
def test_profiles_change_only_variation_and_selection(profile):
    assert ISLAND_PROFILES[profile].keys() <= BREEDING


@every_profile
def test_profiles_other_than_plain_change_the_offspring(profile):
    plain_problem = Problem(recorded(), replace(SETTINGS, population=12))
    profile_problem = replace(plain_problem, settings=replace(plain_problem.settings, characters=(profile,)))
    island = islands_of(Evaluator(recorded(), plain_problem.settings), 1)[-1]
    one, other = run_next_epoch(island, plain_problem), run_next_epoch(island, profile_problem)
    assert (exactly(one.island) == exactly(other.island)) == (profile == "plain")


@every_profile
def test_fitness_does_not_depend_on_the_profile(profile):
    search_problem = Problem(recorded(), replace(SETTINGS, characters=(profile,)))
    epoch = run_next_epoch(Island(0, 3, -1, (), (), HallOfFame()), search_problem)
    population = [each for each in epoch.island.population if each.fitness < inf]
    assert population
    own = Evaluator(recorded(), search_problem.settings_of(0))
    population_ = [
        (Individual(each.genes), pruned) for each in (*population, *models()) for pruned in (False, True)
    ]
    assert repr(own.evaluate(population_)) == repr(Evaluator(recorded(), SETTINGS).evaluate(population_))
    exact, _ = evaluator().evaluate([(Individual(each.genes), False) for each in population])
    assert repr(list(exact)) == repr(population)
