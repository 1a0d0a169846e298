"""Tournament selection."""

from collections import Counter
from math import nan

import pytest

from islands.evolution.individual import Individual
from islands.evolution.rng import Purpose, Stream
from islands.evolution.selection import tournament
from islands.model.expression import Lagged


def pool(*fitness):
    return [Individual((Lagged(0, lag),), fitness=value) for lag, value in enumerate(fitness, start=1)]


def stream(seed=0):
    return Stream(seed, 0, 1, Purpose.SELECTION)


def test_the_fittest_of_many_contestants_wins():
    assert tournament(pool(3.0, 1.0, 2.0), 60, stream()).fitness == 1.0


def test_a_tournament_of_one_is_a_draw_among_all():
    draw = stream()
    counted = Counter(tournament(pool(3.0, 1.0, 2.0), 1, draw).fitness for _ in range(3000))
    assert all(abs(count - 1000) < 4 * (3000 * 2 / 9) ** 0.5 for count in counted.values())


@pytest.mark.parametrize("contestants", [2, 3, 5])
def test_the_best_of_n_wins_as_often_as_it_is_drawn(contestants):
    """With replacement it is among k contestants with probability 1 - (1 - 1/n)^k."""
    draw, among = stream(), pool(4.0, 1.0, 2.0, 3.0)
    share = sum(tournament(among, contestants, draw).fitness == 1.0 for _ in range(4000)) / 4000
    assert share == pytest.approx(1 - 0.75**contestants, abs=0.032)


def test_ties_go_to_the_one_drawn_first():
    among = pool(1.0, 1.0, 1.0, 1.0)
    for seed in range(20):
        assert tournament(among, 3, stream(seed)) is stream(seed).pick(among)


def test_it_takes_one_draw_a_contestant():
    draw, other, among = stream(), stream(), pool(2.0, 1.0, nan)
    tournament(among, 4, draw)
    for _ in range(4):
        other.pick(among)
    assert draw.below(10**9) == other.below(10**9)


def test_not_a_number_counts_as_the_worst():
    assert Individual((Lagged(0),), fitness=nan).fitness == float("inf")
    assert tournament(pool(nan, 7.0, nan), 60, stream()).fitness == 7.0
