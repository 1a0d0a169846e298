"""Properties of the hall of fame: merging is commutative, associative and idempotent."""

from collections import Counter
from itertools import pairwise
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.hall_of_fame import HallOfFame, merge, pareto_front, with_entries
from islands.evolution.individual import Individual, make_regressor
from islands.expressions.parsing import parse
from islands.expressions.tree import Lagged, Shift
from islands.models.narx import canonical_order

#: The leaves give more structures of one size than a hall keeps.
LEAVES = [Lagged(channel, lag) for channel in (0, 1) for lag in (1, 2, 3, 4, 5, 6)]

#: Few values make ties common; some are failures.
FITNESSES = [0.25, 0.5, 1.0, 2.0, 3.0, inf, nan]


@st.composite
def individuals(draw):
    """Draw small models; equal structures may have different genes, parameters and fitnesses."""
    leaves = draw(st.lists(st.sampled_from(LEAVES), min_size=1, max_size=3, unique=True))
    genes = []
    for leaf in leaves:
        # u(k-3) and q2(u(k-1)) are the same structure.
        shift = draw(st.integers(0, leaf.lag - 1))
        genes.append(Shift(shift, Lagged(leaf.channel, leaf.lag - shift)) if shift else leaf)
    regressors = tuple(canonical_order(make_regressor(gene) for gene in genes))
    theta = tuple(draw(st.sampled_from([-1.0, 0.5, 1.0])) for _ in regressors)
    return Individual(tuple(genes), regressors, theta, draw(st.sampled_from(FITNESSES)))


halls = st.lists(individuals(), max_size=25).map(lambda found: with_entries(HallOfFame(), found))


def exactly(hall):
    """Return all content for exact comparison; equality of regressors compares only their text."""
    return [
        (
            [repr(gene) for gene in entry.genes],
            [repr(item.expression) for item in entry.regressors],
            entry.theta,
            entry.fitness,
            entry.outcome,
        )
        for entry in hall.entries
    ]


@given(halls, halls)
def test_merging_is_commutative(one, other):
    assert exactly(merge([one, other])) == exactly(merge([other, one]))


@given(halls, halls, halls)
def test_merging_is_associative(one, other, third):
    together = exactly(merge([one, other, third]))
    assert exactly(merge([merge([one, other]), third])) == together
    assert exactly(merge([one, merge([other, third])])) == together


@given(halls, halls)
def test_merging_is_idempotent(one, other):
    assert exactly(merge([one, one])) == exactly(one)
    both = merge([one, other])
    assert exactly(merge([both, one, other, both])) == exactly(both)
    assert exactly(merge([one, HallOfFame()])) == exactly(one)


@given(st.lists(individuals(), max_size=30), st.randoms(use_true_random=False))
def test_order_of_individuals_does_not_matter(found, random):
    expected = exactly(with_entries(HallOfFame(), found))
    shuffled = list(found)
    random.shuffle(shuffled)
    assert exactly(with_entries(HallOfFame(), shuffled)) == expected
    one_by_one = HallOfFame()
    for each in shuffled:
        one_by_one = with_entries(one_by_one, [each])
    assert exactly(one_by_one) == expected


@given(st.lists(individuals(), max_size=40))
def test_hall_keeps_the_best_distinct_structures_of_every_size(found):
    hall = with_entries(HallOfFame(), found)
    best = {}
    for each in found:
        if each.fitness < inf:
            best[each.key] = min(each.fitness, best.get(each.key, inf))
    for size in (1, 2, 3):
        expected = sorted(value for key, value in best.items() if len(key) == size)[: Individual.kept]
        kept = [entry for entry in hall.entries if entry.size == size]
        assert [entry.fitness for entry in kept] == expected
        assert [best[entry.key] for entry in kept] == expected
    assert max(Counter(entry.key for entry in hall.entries).values(), default=1) == 1
    assert [entry.size for entry in hall.entries] == sorted(entry.size for entry in hall.entries)


@given(halls)
def test_fitness_improves_along_the_pareto_front(hall):
    best = pareto_front(hall.entries)
    assert all(one.size < other.size and one.fitness > other.fitness for one, other in pairwise(best))
    for entry in hall.entries:
        assert min(each.fitness for each in best if each.size <= entry.size) <= entry.fitness
    assert hall.best() == {
        size: next(entry for entry in hall.entries if entry.size == size)
        for size in {entry.size for entry in hall.entries}
    }


def entry(fitness, *texts, theta=None):
    genes = tuple(parse(text) for text in texts)
    regressors = tuple(canonical_order(make_regressor(gene) for gene in genes))
    return Individual(genes, regressors, theta or (1.0,) * len(genes), fitness)


@pytest.mark.parametrize("fitness", [nan, inf, -inf])
def test_non_finite_fitness_never_enters(fitness):
    assert with_entries(HallOfFame(), [entry(fitness, "y(k-1)")]) == HallOfFame()
    good = with_entries(HallOfFame(), [entry(3.0, "y(k-1)")])
    assert with_entries(good, [entry(fitness, "y(k-1)")]) == good
