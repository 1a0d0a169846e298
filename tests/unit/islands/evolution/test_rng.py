"""Derived random streams: golden values, dependence on the key, distributions."""

from collections import Counter
from random import Random

import pytest
from numpy.random import SeedSequence

from islands.evolution.rng import Purpose, Stream


def draws(*key, count=3):
    stream = Stream(*key)
    return [stream.randrange(10**9) for _ in range(count)]


def test_first_draws_of_streams_have_golden_values():
    """A change of these numbers changes every result."""
    assert draws(7, 2, 5, Purpose.VARIATION) == [706801824, 370716385, 854406074]
    assert draws(0, 0, 0, Purpose.INITIAL) == [605072147, 603373414, 266772214]


def test_numbers_of_the_purposes_are_fixed():
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
    keys = [
        (seed, island, generation, purpose)
        for seed in (0, 1)
        for island in (0, 1)
        for generation in (0, 1)
        for purpose in Purpose
    ]
    # 56 streams of three draws from 10^9 numbers: two draws are equal with a probability of 1 in 70 000.
    assert len({number for key in keys for number in draws(*key)}) == 3 * len(keys)


def test_streams_with_equal_keys_draw_equal_numbers():
    assert draws(5, 1, 9, Purpose.PRUNING, count=50) == draws(5, 1, 9, Purpose.PRUNING, count=50)


def test_many_draws_are_those_of_single_draws_and_of_the_standard_library():
    for island in range(50):
        key = 5, island, 9, Purpose.PRUNING
        one, many = Stream(*key), Stream(*key)
        words = SeedSequence(5, spawn_key=(island, 9, Purpose.PRUNING)).generate_state(4)
        expected = Random(int.from_bytes(words.tobytes(), "little"))
        drawn = [*many.draw(3).tolist(), *many.draw(4).tolist()]
        assert drawn == [expected.random() for _ in range(7)]
        assert [one.chance(each) for each in drawn] == [False] * 7


def test_chance_has_the_given_probability():
    stream = Stream(1, 0, 0, Purpose.SELECTION)
    share = sum(stream.chance(0.2) for _ in range(20_000)) / 20_000
    # Four standard deviations of a binomial proportion.
    assert share == pytest.approx(0.2, abs=4 * (0.2 * 0.8 / 20_000) ** 0.5)
    assert not any(stream.chance(0.0) for _ in range(1000))
    assert all(stream.chance(1.0) for _ in range(1000))


def test_randrange_is_uniform_below_the_bound():
    stream = Stream(1, 0, 0, Purpose.SELECTION)
    counted = Counter(stream.randrange(5) for _ in range(20_000))
    assert sorted(counted) == [0, 1, 2, 3, 4]
    assert all(abs(count - 4000) < 4 * (20_000 * 0.2 * 0.8) ** 0.5 for count in counted.values())


def test_choice_is_uniform():
    stream = Stream(1, 0, 0, Purpose.INITIAL)
    counted = Counter(stream.choice("abc") for _ in range(9000))
    assert sorted(counted) == ["a", "b", "c"]
    assert all(abs(count - 3000) < 4 * (9000 * 2 / 9) ** 0.5 for count in counted.values())
