"""Topologies: from whom an island receives, and what cannot be laid out."""

from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands.evolution.migration.topology import TOPOLOGIES, WITH_DEGREE, topology
from support.strategies import edges, layouts

#: What every number of islands up to here has to obey: primes, squares and what has many divisors.
NUMBERS = range(1, 41)

NAMED = [name for name in TOPOLOGIES if name not in WITH_DEGREE]

seeds = st.integers(0, 2**32 - 1)


def sources(text, islands, seed=0):
    return topology(text, islands, seed).sources


def out_degrees(laid):
    given_away = list(chain(*laid))
    return [given_away.count(island) for island in range(len(laid))]


def both_ways(laid):
    return all(island in laid[source] for island, each in enumerate(laid) for source in each)


def reached(laid, start):
    """All whose individuals may come to an island, itself among them."""
    found, new = {start}, [start]
    while new:
        fresh = set(laid[new.pop()]) - found
        found |= fresh
        new += fresh
    return found


def strongly_connected(laid):
    return all(len(reached(laid, island)) == len(laid) for island in range(len(laid)))


# What all topologies have in common.


@given(layouts(40), seeds)
def test_sources_ascend_in_range_and_nobody_is_its_own(layout, seed):
    text, islands = layout
    laid = topology(text, islands, seed)
    assert len(laid.sources) == islands
    for island, each in enumerate(laid.sources):
        assert list(each) == sorted(set(each))
        assert set(each) <= set(range(islands)) - {island}
    assert laid.in_degree == max(len(each) for each in laid.sources)


@given(layouts(20), seeds)
def test_the_same_text_number_and_seed_give_the_same_topology(layout, seed):
    """The cache is left out: it would hide what differs."""
    text, islands = layout
    assert topology.__wrapped__(text, islands, seed) == topology.__wrapped__(text, islands, seed)


@pytest.mark.parametrize("name", [name for name in TOPOLOGIES if name != "isolated"])
def test_whoever_is_not_isolated_is_reached_by_everybody(name):
    for islands in NUMBERS[2:] if name in WITH_DEGREE else NUMBERS:
        assert strongly_connected(sources(name, islands)), islands


@pytest.mark.parametrize("name", NAMED)
def test_one_island_receives_from_nobody(name):
    assert sources(name, 1) == ((),)
    assert topology(name, 1, 0).in_degree == 0


# Each by its definition.


def test_the_isolated_receive_from_nobody():
    for islands in NUMBERS:
        assert sources("isolated", islands) == ((),) * islands
        assert topology("isolated", islands, 0).in_degree == 0


def test_on_a_ring_everybody_receives_from_the_one_before():
    assert sources("ring", 4) == ((3,), (0,), (1,), (2,))
    for islands in NUMBERS[1:]:
        laid = sources("ring", islands)
        assert laid == tuple(((island - 1) % islands,) for island in range(islands))
        assert out_degrees(laid) == [1] * islands
        assert both_ways(laid) == (islands == 2)


def test_on_a_bidirectional_ring_everybody_receives_from_both_neighbours():
    assert sources("bidirectional-ring", 4) == ((1, 3), (0, 2), (1, 3), (0, 2))
    for islands in NUMBERS[2:]:
        laid = sources("bidirectional-ring", islands)
        assert {len(each) for each in laid} == {2}
        assert both_ways(laid)
        assert all(island - 1 in laid[island] for island in range(1, islands))


def test_all_receive_from_all_others_where_fully_connected():
    for islands in NUMBERS:
        everybody = set(range(islands))
        laid = sources("fully-connected", islands)
        assert [set(each) for each in laid] == [everybody - {island} for island in range(islands)]


def test_on_a_star_island_0_gives_to_all_and_receives_from_all():
    for islands in NUMBERS:
        hub, *others = sources("star", islands)
        assert hub == tuple(range(1, islands))
        assert others == [(0,)] * (islands - 1)


def test_a_torus_is_the_grid_nearest_to_a_square_closed_in_both_directions():
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


def test_a_torus_has_four_neighbours_and_less_where_it_is_two_or_one_wide():
    neighbours = {1: 0, 2: 1}
    for rows, columns in ((1, 1), (1, 2), (1, 7), (2, 2), (2, 3), (3, 3), (3, 5), (4, 4), (5, 8)):
        laid = sources("torus", rows * columns)
        assert {len(each) for each in laid} == {neighbours.get(rows, 2) + neighbours.get(columns, 2)}
        assert both_ways(laid)


@pytest.mark.parametrize("prime", [2, 3, 5, 7, 31])
def test_a_torus_of_a_prime_number_is_a_ring(prime):
    assert sources("torus", prime) == sources("bidirectional-ring", prime)


# Random ones.


@given(st.data(), st.integers(2, 14), seeds)
def test_random_regular_ones_give_to_as_many_as_they_receive_from_and_reach_everybody(data, islands, seed):
    degree = data.draw(st.integers(1, islands - 1))
    laid = sources(f"random-regular:{degree}", islands, seed)
    assert [len(each) for each in laid] == [degree] * islands
    assert out_degrees(laid) == [degree] * islands
    assert strongly_connected(laid)


def test_no_seed_leaves_a_part_that_is_cut_off():
    """Of four islands that are switched at random many fall into two pairs; all of these are thrown away."""
    for seed in range(300):
        for islands in (4, 6):
            assert strongly_connected(sources("random-regular:2", islands, seed)), seed


def test_random_regular_ones_differ_with_the_seed_and_every_edge_comes():
    drawn = [sources("random-regular:2", 8, seed) for seed in range(60)]
    assert len(set(drawn)) > 50
    for island in range(8):
        assert set(chain(*(laid[island] for laid in drawn))) == set(range(8)) - {island}


def test_a_degree_of_one_is_a_ring_and_of_all_others_fully_connected():
    for islands in range(2, 9):
        assert sources("random-regular:1", islands, 5) == sources("ring", islands)
        assert sources(f"random-regular:{islands - 1}", islands, 5) == sources("fully-connected", islands)


def test_random_regular_without_a_degree_has_two():
    assert sources("random-regular", 9, 3) == sources("random-regular:2", 9, 3)


def test_a_random_topology_is_what_it_has_always_been():
    """Golden: a change of it changes every result that anybody has."""
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
def test_a_list_of_edges_is_read_as_written(data, islands, spaces):
    drawn = data.draw(edges(islands))
    arrow, comma = (" > ", " , ") if spaces else (">", ",")
    text = comma.join(f"{source}{arrow}{target}" for source, target in [*drawn, drawn[0]])
    laid = sources(text, islands)
    assert {(source, target) for target, each in enumerate(laid) for source in each} == set(drawn)


def test_an_edge_goes_from_its_first_island_to_its_second():
    assert sources("0>1,1>2,0>2", 4) == ((), (0,), (0, 1), ())


# What is refused.


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
                f"{islands} islands of degree {degree} have more than 50000 edges to draw: take a",
            )
            for degree, islands in ((1, 50_001), (2, 25_001), (6, 10_000), (99, 1_000))
        ),
        ("fully-connected", 1001, "at most 1000 islands are fully connected, got 1001: take a torus"),
        *(
            (f"0>1,{edge}", 4, f"cannot read the edge {edge!r}: write FROM>TO, for example 0>1,1>0")
            for edge in (
                *("", "1", "1>", ">2", ">", "1>2>3", "1>-2", "one>two", "1.0>2", "1<2", "1 2>3"),
                # Python itself would refuse to read the longest ones.
                *("0000000001>2", "1>1234567890", "9" * 5000 + ">1", "1>" + "0" * 5000),
            )
        ),
        *(
            (f"0>1, {edge} ", 4, f"the edge {edge} does not join two of the islands 0 to 3")
            for edge in ("0>4", "4>0", "2>2", "17>18", "1>999999999", "000000002>2")
        ),
    ],
)
def test_what_cannot_be_laid_out_is_refused_with_a_reason(text, islands, message):
    with pytest.raises(SettingsError) as refused:
        topology(text, islands, 0)
    assert str(refused.value).startswith(message)


@pytest.mark.ci
def test_as_many_edges_as_may_be_drawn_and_a_degree_of_99_are_laid_out():
    assert topology.__wrapped__("random-regular:1", 50_000, 0).in_degree == 1
    assert topology.__wrapped__("random-regular:99", 100, 0).in_degree == 99
    assert topology.__wrapped__("random-regular:10", 30, 0).in_degree == 10


def test_a_number_of_nine_digits_is_read_in_an_edge():
    assert sources("000000001>000000002", 3) == ((), (), (1,))


def test_a_thousand_islands_may_be_fully_connected():
    assert topology.__wrapped__("fully-connected", 1000, 0).in_degree == 999


@given(st.text("0123> ,:ring", max_size=10), st.integers(1, 4))
def test_any_text_is_laid_out_or_refused(text, islands):
    try:
        laid = topology(text, islands, 0)
    except SettingsError:
        return
    assert len(laid.sources) == islands
