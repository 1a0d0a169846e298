"""Derived random numbers: the same place in a run draws the same ones, another place other ones."""

from collections import Counter

import pytest

from islands.evolution.gp.rng import Purpose, Stream


def draws(*place, count=3):
    stream = Stream(*place)
    return [stream.randrange(10**9) for _ in range(count)]


def test_the_first_draws_of_a_stream_are_what_they_have_always_been():
    """Golden: a change of these numbers changes every result that anybody has."""
    assert draws(7, 2, 5, Purpose.VARIATION) == [706801824, 370716385, 854406074]
    assert draws(0, 0, 0, Purpose.INITIAL) == [605072147, 603373414, 266772214]


def test_the_numbers_of_the_purposes_are_part_of_every_result():
    assert [(purpose.name, int(purpose)) for purpose in Purpose] == [
        ("INITIAL", 0),
        ("SELECTION", 1),
        ("VARIATION", 2),
        ("PRUNING", 3),
        ("EMIGRATION", 4),
        ("IMMIGRATION", 5),
        ("TOPOLOGY", 6),
    ]


def test_streams_differ_by_seed_island_generation_and_purpose():
    places = [
        (seed, island, generation, purpose)
        for seed in (0, 1)
        for island in (0, 1)
        for generation in (0, 1)
        for purpose in Purpose
    ]
    # 56 streams of three draws out of 10^9: no two draws are equal but by a chance of 1 in 70 000.
    assert len({number for place in places for number in draws(*place)}) == 3 * len(places)


def test_the_same_place_draws_the_same():
    assert draws(5, 1, 9, Purpose.PRUNING, count=50) == draws(5, 1, 9, Purpose.PRUNING, count=50)


def test_chance_meets_its_probability():
    stream = Stream(1, 0, 0, Purpose.SELECTION)
    share = sum(stream.chance(0.2) for _ in range(20_000)) / 20_000
    # Four standard deviations of a binomial share.
    assert share == pytest.approx(0.2, abs=4 * (0.2 * 0.8 / 20_000) ** 0.5)
    assert not any(stream.chance(0.0) for _ in range(1000))
    assert all(stream.chance(1.0) for _ in range(1000))


def test_whole_numbers_are_drawn_evenly_from_0_to_below_the_bound():
    stream = Stream(1, 0, 0, Purpose.SELECTION)
    counted = Counter(stream.randrange(5) for _ in range(20_000))
    assert sorted(counted) == [0, 1, 2, 3, 4]
    assert all(abs(count - 4000) < 4 * (20_000 * 0.2 * 0.8) ** 0.5 for count in counted.values())


def test_items_are_drawn_evenly():
    stream = Stream(1, 0, 0, Purpose.INITIAL)
    counted = Counter(stream.choice("abc") for _ in range(9000))
    assert sorted(counted) == ["a", "b", "c"]
    assert all(abs(count - 3000) < 4 * (9000 * 2 / 9) ** 0.5 for count in counted.values())
