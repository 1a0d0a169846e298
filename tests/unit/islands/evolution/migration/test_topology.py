"""Topologies: definitions, random graphs, lists of edges, invalid texts."""

from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands.evolution.migration.topology import TOPOLOGIES, WITH_DEGREE, parse_topology
from support.strategies import edges, layouts

#: Numbers of islands: primes, squares and numbers with many divisors.
NUMBERS = range(1, 41)

NAMED = [name for name in TOPOLOGIES if name not in WITH_DEGREE]

seeds = st.integers(0, 2**32 - 1)


def sources(text, islands, seed=0):
    return parse_topology(text, islands, seed).sources


def out_degrees(built):
    targets = list(chain(*built))
    return [targets.count(island) for island in range(len(built))]


def is_symmetric(built):
    return all(island in built[source] for island, each in enumerate(built) for source in each)


def reachable(built, start):
    """Return all islands whose individuals can reach an island, including the island."""
    found, new = {start}, [start]
    while new:
        unseen = set(built[new.pop()]) - found
        found |= unseen
        new += unseen
    return found


def strongly_connected(built):
    return all(len(reachable(built, island)) == len(built) for island in range(len(built)))


# Properties of all topologies.


@given(layouts(40), seeds)
def test_sources_are_ascending_valid_and_exclude_the_island(layout, seed):
    text, islands = layout
    built = parse_topology(text, islands, seed)
    assert len(built.sources) == islands
    for island, each in enumerate(built.sources):
        assert list(each) == sorted(set(each))
        assert set(each) <= set(range(islands)) - {island}
    assert built.in_degree == max(len(each) for each in built.sources)


@pytest.mark.parametrize("name", [name for name in TOPOLOGIES if name != "isolated"])
def test_named_topologies_are_strongly_connected(name):
    for islands in NUMBERS[2:] if name in WITH_DEGREE else NUMBERS:
        assert strongly_connected(sources(name, islands)), islands


@pytest.mark.parametrize("name", NAMED)
def test_single_island_has_no_sources(name):
    assert sources(name, 1) == ((),)
    assert parse_topology(name, 1, 0).in_degree == 0


# Definitions of the topologies.


def test_star_connects_island_0_with_all_others():
    for islands in NUMBERS:
        hub, *others = sources("star", islands)
        assert hub == tuple(range(1, islands))
        assert others == [(0,)] * (islands - 1)


def test_torus_is_the_most_square_grid_closed_in_both_directions():
    # Three rows of four.
    assert sources("torus", 12)[:2] == ((1, 3, 4, 8), (0, 2, 5, 9))
    for islands in NUMBERS:
        rows = max(rows for rows in range(1, islands + 1) if islands % rows == 0 and rows**2 <= islands)
        columns = islands // rows

        def apart(one, other, around):
            return min((one - other) % around, (other - one) % around)

        for island, each in enumerate(sources("torus", islands)):
            (row, column), places = (
                divmod(island, columns),
                [divmod(other, columns) for other in range(islands)],
            )
            assert each == tuple(
                other
                for other, (there, across) in enumerate(places)
                if apart(row, there, rows) + apart(column, across, columns) == 1
            )


def test_torus_has_fewer_than_four_neighbours_if_two_or_one_wide():
    neighbours = {1: 0, 2: 1}
    for rows, columns in ((1, 1), (1, 2), (1, 7), (2, 2), (2, 3), (3, 3), (3, 5), (4, 4), (5, 8)):
        built = sources("torus", rows * columns)
        assert {len(each) for each in built} == {neighbours.get(rows, 2) + neighbours.get(columns, 2)}
        assert is_symmetric(built)


# Random topologies.


@given(st.data(), st.integers(2, 14), seeds)
def test_random_regular_graphs_are_regular_and_strongly_connected(data, islands, seed):
    degree = data.draw(st.integers(1, islands - 1))
    built = sources(f"random-regular:{degree}", islands, seed)
    assert [len(each) for each in built] == [degree] * islands
    assert out_degrees(built) == [degree] * islands
    assert strongly_connected(built)


def test_random_regular_graphs_differ_by_seed_and_use_all_edges():
    drawn = [sources("random-regular:2", 8, seed) for seed in range(60)]
    assert len(set(drawn)) > 50
    for island in range(8):
        assert set(chain(*(built[island] for built in drawn))) == set(range(8)) - {island}


def test_random_topologies_have_golden_values():
    """A change of these topologies changes every result that uses them."""
    assert sources("random-regular:2", 6, 7) == ((1, 2), (2, 3), (4, 5), (0, 4), (0, 5), (1, 3))
    assert sources("random-regular:3", 6, 0) == (
        (1, 2, 4),
        (3, 4, 5),
        (3, 4, 5),
        (0, 2, 5),
        (0, 1, 2),
        (0, 1, 3),
    )


# Lists of edges.


@given(st.data(), st.integers(2, 9), st.booleans())
def test_list_of_edges_is_parsed_as_written(data, islands, spaces):
    drawn = data.draw(edges(islands))
    arrow, comma = (" > ", " , ") if spaces else (">", ",")
    text = comma.join(f"{source}{arrow}{target}" for source, target in [*drawn, drawn[0]])
    built = sources(text, islands)
    assert {(source, target) for target, each in enumerate(built) for source in each} == set(drawn)


# Invalid topologies.


@pytest.mark.parametrize(
    ("text", "islands", "message"),
    [
        (
            "",
            4,
            "unknown topology '': take one of isolated, ring, bidirectional-ring, torus, fully-connected",
        ),
        ("circle", 4, "unknown topology 'circle': take one of isolated, ring"),
        ("Ring", 4, "unknown topology 'Ring': take one of isolated, ring"),
        (" ring", 4, "unknown topology ' ring': take one of isolated, ring"),
        ("circle:3", 4, "unknown topology 'circle': take one of isolated, ring"),
        *(
            (text, 200, f"topology {text!r}: a degree from 1 to 99 goes with random-regular alone")
            for text in (
                *("ring:2", "torus:4", "star:1", "ring:", "fully-connected:", "ring:2:2", "ring:\n"),
                *("random-regular:0", "random-regular:-1", "random-regular:x", "random-regular:2.0"),
                *("random-regular:2:2", "random-regular: 2", "random-regular:2 ", "random-regular:2\n"),
                *("random-regular:", "random-regular:04", "random-regular:100", "random-regular:+2"),
                "random-regular:" + "9" * 5000,
            )
        ),
        ("random-regular:4", 4, "random-regular:4 takes more than 4 islands, got 4"),
        ("random-regular:9", 4, "random-regular:9 takes more than 9 islands, got 4"),
        ("random-regular", 2, "random-regular:2 takes more than 2 islands, got 2"),
        *(
            (
                f"random-regular:{degree}",
                islands,
                f"{islands} islands of degree {degree} have more than 50000 edges: take a",
            )
            for degree, islands in ((1, 50_001), (2, 25_001), (6, 10_000), (99, 1_000))
        ),
        ("fully-connected", 1001, "at most 1000 islands are fully connected, got 1001: take a torus"),
        *(
            (f"0>1,{edge}", 4, f"cannot read the edge {edge!r}: write FROM>TO, for example 0>1,1>0")
            for edge in (
                *("", "1", "1>", ">2", ">", "1>2>3", "1>-2", "one>two", "1.0>2", "1<2", "1 2>3"),
                # Python refuses to convert the longest ones to integers.
                *("0000000001>2", "1>1234567890", "9" * 5000 + ">1", "1>" + "0" * 5000),
            )
        ),
        *(
            (f"0>1, {edge} ", 4, f"the edge {edge} does not join two of the islands 0 to 3")
            for edge in ("0>4", "4>0", "2>2", "17>18", "1>999999999", "000000002>2")
        ),
    ],
)
def test_invalid_topologies_raise_settings_error_with_a_reason(text, islands, message):
    with pytest.raises(SettingsError) as refused:
        parse_topology(text, islands, 0)
    assert str(refused.value).startswith(message)


@given(st.text("0123> ,:ring", max_size=10), st.integers(1, 4))
def test_arbitrary_text_is_built_or_raises_settings_error(text, islands):
    try:
        built = parse_topology(text, islands, 0)
    except SettingsError:
        return
    assert len(built.sources) == islands
