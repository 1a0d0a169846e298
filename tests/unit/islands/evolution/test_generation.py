"""Tournament selection."""

from math import inf, isfinite, nan

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.generation import run_tournaments
from islands.evolution.individual import Individual
from islands.evolution.rng import Purpose, Stream
from islands.expressions.tree import Lagged


def pool(*fitness):
    return [Individual((Lagged(0, lag),), fitness=value) for lag, value in enumerate(fitness, start=1)]


def stream(seed=0):
    return Stream(seed, 0, 1, Purpose.SELECTION)


def expect_no_evaluation(places):
    """Evaluator for a pool without abandoned individuals."""
    assert places.size == 0
    return np.empty(0)


def run(fitness, abandoned, *others):
    """Return the places of the winners."""
    return run_tournaments(np.array(fitness), np.array(abandoned, np.bool_), *others).tolist()


def winners(among, count, contestants, draw):
    fitness = [each.fitness for each in among]
    found = run(fitness, [False] * len(among), count, contestants, draw, inf, expect_no_evaluation)
    return [among[place] for place in found]


def test_tournaments_take_one_draw_per_contestant():
    draw, other, among = stream(), stream(), pool(2.0, 1.0, nan)
    found = winners(among, 5, 4, draw)
    for each in found:
        drawn = [other.choice(among) for _ in range(4)]
        assert each is min(drawn, key=lambda contestant: contestant.fitness)
    assert draw.randrange(10**9) == other.randrange(10**9)


seeds = st.integers(0, 2**32 - 1)


@given(st.lists(st.sampled_from([nan, inf, 1.0, 2.0]), min_size=1, max_size=5), seeds)
def test_failure_never_wins_against_a_finite_fitness(values, seed):
    (winner,) = winners(pool(*values), 1, 6, stream(seed))
    replayed = stream(seed)
    contestants = [replayed.choice(values) for _ in range(6)]
    assert winner.fitness == min((value for value in contestants if isfinite(value)), default=inf)


# Abandoned contestants.


@st.composite
def pools(draw):
    """Draw the fitness of individuals, and which of those above the threshold are abandoned.

    Few different values make ties common. Some individuals above the threshold have a known fitness.
    """
    values = draw(st.lists(st.sampled_from([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, inf]), min_size=1, max_size=12))
    threshold = draw(st.sampled_from([0.25, 1.0, 1.75, 2.0, 5.0, inf]))
    return values, [value > threshold and draw(st.booleans()) for value in values], threshold


@given(pools(), st.integers(0, 6), st.integers(1, 5), seeds)
def test_winners_do_not_depend_on_abandoned_individuals(drawn, count, contestants, seed):
    known, abandoned, threshold = drawn
    fitness = np.where(abandoned, inf, known)
    evaluated = []

    def evaluate_abandoned(places):
        evaluated.extend(places.tolist())
        return np.array(known)[places]

    found = run(fitness, abandoned, count, contestants, stream(seed), threshold, evaluate_abandoned)
    complete = [False] * len(known)
    assert found == run(known, complete, count, contestants, stream(seed), inf, expect_no_evaluation)
    assert fitness.tolist() == np.where(abandoned, inf, known).tolist()

    # Abandoned contestants are evaluated once, if no contestant has a known fitness within the threshold.
    replayed, needed = stream(seed), set()
    for _ in range(count):
        met = [replayed.randrange(len(known)) for _ in range(contestants)]
        if all(fitness[place] > threshold for place in met):
            needed |= {place for place in met if abandoned[place]}
    assert sorted(evaluated) == sorted(needed)
