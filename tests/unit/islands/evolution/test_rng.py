"""Derived random streams: golden values, dependence on the key, distributions."""

from random import Random

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


def test_many_draws_are_those_of_single_draws_and_of_the_standard_library():
    for island in range(50):
        key = 5, island, 9, Purpose.PRUNING
        one, many = Stream(*key), Stream(*key)
        words = SeedSequence(5, spawn_key=(island, 9, Purpose.PRUNING)).generate_state(4)
        expected = Random(int.from_bytes(words.tobytes(), "little"))
        drawn = [*many.draw(3).tolist(), *many.draw(4).tolist()]
        assert drawn == [expected.random() for _ in range(7)]
        assert [one.chance(each) for each in drawn] == [False] * 7
