"""Islands in the middle of a run, and who may leave them and arrive at them."""

from dataclasses import replace
from functools import cache
from itertools import chain
from math import isfinite

import pytest
from hypothesis import strategies as st

from islands.evolution.epoch import run_epoch
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.gp.individual import Individual
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.island import Island, select_elite
from islands.evolution.migration.policies import REPLACEMENT_POLICIES, SELECTION_POLICIES
from support.searches import SMALL, islands_of, record

#: Individuals fail now and then, and copies get into the elite.
SETTINGS = replace(
    SMALL,
    population=6,
    elite=0.5,
    migrate_every=3,
    migrants=2,
    constraints="none",
    structure="free",
    primitives=("mul", "phi1", "phi2", "tanh", "cube"),
)

every_emigrants = pytest.mark.parametrize("leave", SELECTION_POLICIES)
every_replaced = pytest.mark.parametrize("replaced", REPLACEMENT_POLICIES)


def never():
    return False


@cache
def recorded():
    return record(150)


@cache
def evaluator():
    return Evaluator(recorded(), SETTINGS)


@cache
def folk():
    """Everybody who lived in two short runs: models, failures, and some who were abandoned."""
    larger = Evaluator(recorded(), replace(SETTINGS, population=40))
    found = chain(*(island.population for seed in (1, 2) for island in islands_of(larger, 4, seed)))
    return list({each.key: each for each in found}.values())


def models():
    return [each for each in folk() if isfinite(each.fitness)]


@cache
def known_fitness(genes):
    patient = Evaluator(recorded(), SETTINGS, abandon=False)
    return patient.evaluate([(Individual(genes), False)])[0][0].fitness


def keys(population):
    return [each.key for each in population]


@st.composite
def islands(draw, distinct=False):
    """An island in the middle of a run, in whose elite and population are models and failures, and copies."""
    several = st.lists(st.sampled_from(folk()), min_size=SETTINGS.population, max_size=SETTINGS.population)
    population, others = draw(several), draw(several)
    elite = select_elite(others[: draw(st.integers(1, 6))], SETTINGS.elites, distinct)
    index, generation = draw(st.integers(0, 9)), draw(st.integers(0, 12))
    return Island(index, 3, generation, tuple(population), elite, with_entries(HallOfFame(), others), 1.0)


@st.composite
def arrivals(draw):
    """Populations as they come from several sources; each individual an object of its own."""
    some = st.lists(st.sampled_from(models()), max_size=4)
    return [tuple(replace(each) for each in population) for population in draw(st.lists(some, max_size=4))]


def advanced(island, posed, arriving=(), judge=None):
    return run_epoch(island, arriving, judge or Evaluator(posed.record, posed.settings), posed, never)
