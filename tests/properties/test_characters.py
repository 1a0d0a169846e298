"""Laws of characters: they change how an island breeds, and nothing else."""

from dataclasses import fields, replace
from math import inf

import pytest

from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual
from islands.evolution.gp.island_profiles import ISLAND_PROFILES
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.island import Island
from islands.evolution.problem import Problem
from islands.evolution.settings import Settings
from support.migrations import (
    SETTINGS,
    advanced,
    evaluator,
    models,
    recorded,
)
from support.searches import exactly, islands_of

every_character = pytest.mark.parametrize("character", ISLAND_PROFILES)

#: All that a character may change: not one of these says what an individual means, or what it is worth.
BREEDING = {"crossover", "mutation", "prune", "tournament", "high_level", "outer", "from_library"}


@every_character
def test_a_character_changes_only_how_an_island_breeds(character):
    assert ISLAND_PROFILES[character].keys() <= BREEDING


def test_characters_are_given_out_in_turn():
    given_out = tuple(ISLAND_PROFILES)
    posed = Problem(recorded(), replace(SETTINGS, characters=given_out))
    for island in range(3 * len(given_out)):
        character = ISLAND_PROFILES[given_out[island % len(given_out)]]
        for field in fields(Settings):
            value = getattr(posed.settings_of(island), field.name)
            assert value == character.get(field.name, getattr(posed.settings, field.name)), field.name


def test_without_characters_all_islands_have_the_problem_s_settings():
    posed = Problem(recorded(), SETTINGS)
    assert all(posed.settings_of(island) is SETTINGS for island in range(3))
    plain = Problem(recorded(), replace(SETTINGS, characters=("plain",)))
    assert plain.settings_of(5) == plain.settings


@every_character
def test_a_character_breeds_otherwise_and_only_plain_does_not(character):
    alone = Problem(recorded(), replace(SETTINGS, population=12))
    alike = replace(alone, settings=replace(alone.settings, characters=(character,)))
    island = islands_of(Evaluator(recorded(), alone.settings), 1)[-1]
    one, other = advanced(island, alone), advanced(island, alike)
    assert (exactly(one.island) == exactly(other.island)) == (character == "plain")


@every_character
def test_an_individual_is_worth_the_same_on_an_island_of_any_character(character):
    posed = Problem(recorded(), replace(SETTINGS, characters=(character,)))
    epoch = advanced(Island(0, 3, -1, (), (), HallOfFame()), posed)
    population = [each for each in epoch.island.population if each.fitness < inf]
    assert population
    own = Evaluator(recorded(), posed.settings_of(0))
    asked = [
        (Individual(each.genes), pruned) for each in (*population, *models()) for pruned in (False, True)
    ]
    assert repr(own.evaluate(asked)) == repr(Evaluator(recorded(), SETTINGS).evaluate(asked))
    exact, _ = evaluator().evaluate([(Individual(each.genes), False) for each in population])
    assert repr(list(exact)) == repr(population)
