"""Generators of islands during a run, and of immigrants."""

from dataclasses import replace
from functools import cache
from itertools import chain
from math import isfinite

import pytest
from hypothesis import strategies as st

from islands.evolution.archipelago import Island
from islands.evolution.engine import run_epoch
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import select_elite
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual
from islands.evolution.migration import REPLACEMENT_POLICIES, SELECTION_POLICIES
from islands.evolution.problem import GeneEvolution, Problem
from support.searches import SMALL, islands_of, record

#: Some individuals fail, and the elite may contain copies.
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

every_selection_policy = pytest.mark.parametrize("policy", SELECTION_POLICIES)
every_replacement_policy = pytest.mark.parametrize("replaced", REPLACEMENT_POLICIES)


def never_stop():
    return False


@cache
def recorded():
    return record(150)


@cache
def evaluator():
    return Evaluator(recorded(), SETTINGS)


def evolution(settings, evaluator_of_run=None):
    """Return the steps of the islands of a problem without seeds."""
    return GeneEvolution(Problem(recorded(), settings), evaluator_of_run or evaluator())


@cache
def sample_individuals():
    """Return all individuals of two short runs: models, failures and abandoned individuals."""
    larger = Evaluator(recorded(), replace(SETTINGS, population=40))
    found = chain(*(island.population for seed in (1, 2) for island in islands_of(larger, 4, seed)))
    return list({each.key: each for each in found}.values())


def models():
    return [each for each in sample_individuals() if isfinite(each.fitness)]


@cache
def known_fitness(genes):
    patient = Evaluator(recorded(), SETTINGS, abandon=False)
    return patient.evaluate([(Individual(genes), False)])[0][0].fitness


def keys(population):
    return [each.key for each in population]


@st.composite
def islands(draw, distinct=False):
    """Draw an island during a run, with models, failures and copies in its population and elite."""
    several = st.lists(
        st.sampled_from(sample_individuals()), min_size=SETTINGS.population, max_size=SETTINGS.population
    )
    population, others = draw(several), draw(several)
    elite = select_elite(others[: draw(st.integers(1, 6))], SETTINGS.elites, distinct)
    index, generation = draw(st.integers(0, 9)), draw(st.integers(0, 12))
    return Island(index, 3, generation, tuple(population), elite, with_entries(HallOfFame(), others), 1.0)


@st.composite
def arrivals(draw):
    """Draw the emigrants of several sources; every individual is a separate object."""
    some = st.lists(st.sampled_from(models()), max_size=4)
    return [tuple(replace(each) for each in population) for population in draw(st.lists(some, max_size=4))]


def run_next_epoch(island, search_problem, arriving=(), evaluator_of_run=None):
    return run_epoch(
        island,
        arriving,
        GeneEvolution(
            search_problem, evaluator_of_run or Evaluator(search_problem.record, search_problem.settings)
        ),
        never_stop,
    )
