"""Offspring: rows of arrays that are equal to a tuple of individuals."""

import pickle
from dataclasses import replace
from itertools import pairwise

import pytest

from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.generation import first_generation, step
from islands.evolution.offspring import Offspring
from support.searches import SMALL, islands_of, record


@pytest.fixture(scope="module")
def evaluator():
    return Evaluator(record(), SMALL)


@pytest.fixture(scope="module")
def islands(evaluator):
    return islands_of(evaluator, 4)


def test_offspring_are_equal_to_a_tuple_of_individuals(islands):
    for each in (island.population for island in islands):
        assert isinstance(each, Offspring)
        whole = tuple(each)
        assert (each, whole, hash(each), repr(each)) == (whole, each, hash(whole), repr(whole))
        assert each != whole[1:]
        assert each[1:4] == whole[1:4]
        assert each[-1] is whole[-1]
        assert repr(pickle.loads(pickle.dumps(each))) == repr(whole)
        with pytest.raises(IndexError):
            _ = each[len(whole)]


def test_step_from_individuals_equals_the_step_from_arrays(evaluator, islands):
    """Islands from checkpoints, other processes and after an immigration have a tuple of individuals."""
    small = Evaluator(record(), SMALL, Limits(pairs=0, genes=0, structures=0))
    for before, after in pairwise(islands):
        found, info = step(before, evaluator)
        for other in (before, replace(before, population=tuple(before.population))):
            assert repr(step(other, small)) == repr((after, info))
        assert repr(found) == repr(after)


def test_generation_makes_only_the_individuals_that_may_enter_elite_or_hall():
    evaluator = Evaluator(record(), replace(SMALL, population=200, elite=0.02))
    island, _ = first_generation(0, 3, evaluator)
    for _ in range(6):
        island, _ = step(island, evaluator)
    assert 0 < len(island.population._made) < 100
