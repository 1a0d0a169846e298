"""Migration: definitions of topologies, lists of edges, and schedules."""

from itertools import chain, takewhile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands.evolution.migration import TOPOLOGIES, WITH_DEGREE, Schedule, parse_schedule, parse_topology
from support.strategies import edges, layouts, schedule_text, schedules

#: Numbers of islands: primes, squares and numbers with many divisors.
NUMBERS = range(1, 41)


seeds = st.integers(0, 2**32 - 1)

END = 70


def sources(text, islands, seed=0):
    return parse_topology(text, islands, seed).sources


def out_degrees(built):
    targets = list(chain(*built))
    return [targets.count(island) for island in range(len(built))]


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


def is_symmetric(built):
    return all(island in built[source] for island, each in enumerate(built) for source in each)


def test_ring_islands_receive_from_the_previous_island():
    assert sources("ring", 4) == ((3,), (0,), (1,), (2,))
    for islands in NUMBERS[1:]:
        built = sources("ring", islands)
        assert built == tuple(((island - 1) % islands,) for island in range(islands))
        assert out_degrees(built) == [1] * islands
        assert is_symmetric(built) == (islands == 2)


def test_fully_connected_islands_receive_from_all_others():
    for islands in NUMBERS:
        every_island = set(range(islands))
        built = sources("fully-connected", islands)
        assert [set(each) for each in built] == [every_island - {island} for island in range(islands)]


def test_star_connects_island_0_with_all_others():
    for islands in NUMBERS:
        hub, *others = sources("star", islands)
        assert hub == tuple(range(1, islands))
        assert others == [(0,)] * (islands - 1)


# Definitions of the topologies.


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


# Random topologies.


@given(st.data(), st.integers(2, 14), seeds)
def test_random_regular_graphs_are_regular_and_strongly_connected(data, islands, seed):
    degree = data.draw(st.integers(1, islands - 1))
    built = sources(f"random-regular:{degree}", islands, seed)
    assert [len(each) for each in built] == [degree] * islands
    assert out_degrees(built) == [degree] * islands
    assert strongly_connected(built)


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


def simulate_schedule(pieces):
    """Return the value of every generation and all stops, by counting generations."""
    begins, since, values, stops = dict(pieces), 0, [], []
    for generation in range(END):
        since = 0 if generation in begins else since + 1
        values.append(begins.get(generation, values[-1] if values else None))
        if since == values[-1]:
            since = 0
        if since == 0 and generation > 0:
            stops.append(generation)
    return values, stops


def stops_after(read, generation):
    """Yield the stops of a run that continues from stop to stop."""
    while True:
        generation = read.next_stop(generation)
        yield generation


@given(schedules())
def test_stops_are_counted_from_the_beginning_of_each_piece(pieces):
    _, stops = simulate_schedule(pieces)
    read = Schedule(pieces)
    assert [generation for generation in range(-1, END) if read.stops_at(generation)] == stops
    for generation in range(stops[-1]):
        assert read.next_stop(generation) == next(stop for stop in stops if stop > generation)


@given(schedules(), st.integers(0, END))
def test_stops_do_not_depend_on_interruptions(pieces, interrupted):
    read = Schedule(pieces)
    never = takewhile(lambda stop: stop < 2 * END, stops_after(read, 0))
    resumed = takewhile(lambda stop: stop < 2 * END, stops_after(read, interrupted))
    assert list(resumed) == [stop for stop in never if stop > interrupted]


@given(schedules(least=0))
def test_text_of_a_schedule_is_parsed_back(pieces):
    assert parse_schedule(schedule_text(pieces), 0, "migrants") == Schedule(pieces)


@pytest.mark.parametrize(
    ("text", "pieces"),
    [
        (10, ((0, 10),)),
        ("10", ((0, 10),)),
        (" 10 ", ((0, 10),)),
        ("5,100:20", ((0, 5), (100, 20))),
        (" 5 , 100 : 20 ", ((0, 5), (100, 20))),
        ("5,1:6,2:7", ((0, 5), (1, 6), (2, 7))),
        ("7,10:7", ((0, 7), (10, 7))),
        ("1", ((0, 1),)),
        ("3,50:1", ((0, 3), (50, 1))),
        ("999999999,000000100:000000020", ((0, 999_999_999), (100, 20))),
    ],
)
def test_valid_forms_of_a_schedule_are_parsed(text, pieces):
    assert parse_schedule(text, 1, "migrate_every").pieces == pieces


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *(
            (
                text,
                f"cannot read migrate_every {text!r}: write a whole number, or 5,100:20 for 5, and 20 from",
            )
            for text in (
                *("", " ", "often", -1, "-1", 1.5, "1e2", "1 0", "²"),
                *("1" * 10, "0" * 9 + "5", "1" * 5000, 10**9, "5,1000000000:2", "5,1:1000000000"),
                *("5,", ",5", "5,100", "5,100:", "5,:20", "5,100:x", "5,-1:2", "5,10:20:30", "0:5", "5;9:1"),
            )
        ),
        *(
            (text, f"migrate_every {text!r}: its generations ascend, from 1 on")
            for text in ("5,0:7", "5,100:20,100:30", "5,100:20,50:30")
        ),
        *((text, f"migrate_every is at least 1, got {text!r}") for text in (0, "0", "5,100:0", "0,100:5")),
    ],
)
def test_invalid_text_raises_settings_error_with_the_setting(text, message):
    with pytest.raises(SettingsError) as refused:
        parse_schedule(text, 1, "migrate_every")
    assert str(refused.value).startswith(message)


@given(st.text("0123456789,: -x", max_size=12))
def test_arbitrary_text_is_parsed_or_raises_settings_error(text):
    try:
        read = parse_schedule(text, 1, "migrate_every")
    except SettingsError:
        return
    begins = [begin for begin, _ in read.pieces]
    assert begins[0] == 0
    assert begins == sorted(set(begins))
    assert all(value >= 1 for _, value in read.pieces)
