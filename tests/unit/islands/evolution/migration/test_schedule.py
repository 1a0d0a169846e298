"""Schedules: values and stops over the generations, and parsing."""

from itertools import takewhile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import SettingsError
from islands.evolution.migration.schedule import Schedule, parse_schedule
from support.strategies import schedule_text, schedules

END = 70


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
