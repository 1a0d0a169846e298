"""Where a search stands, as it is shown while it goes on."""

from dataclasses import replace
from io import StringIO
from math import inf

import pytest
from rich.console import Console

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.history import HistoryPoint
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands_api.cli import console
from islands_api.cli import search_progress as showing
from islands_api.cli.search_progress import SHOWN, search_progress


@pytest.fixture
def told(monkeypatch):
    """Show states one after the other, four seconds apart; return what is told of them."""

    def show(settings, *states):
        found, clock = [], [100.0]
        monkeypatch.setattr(showing, "monotonic", lambda: clock[0])
        watch = search_progress(lambda text, share, lines=(): found.append((text, share, list(lines))))
        for state in states:
            watch(state, settings)
            clock[0] += 4.0
        return found

    return show


def at(generation, evaluations, *history):
    """A state whose history holds every island's least fitness, generation by generation, up to now."""
    points = tuple(
        HistoryPoint(
            generation - len(history) + 1 + place, evaluations, {1: 4.0, 3: min(least)}, tuple(least)
        )
        for place, least in enumerate(history)
    )
    islands = (
        replace(island, generation=generation) for island in empty_archipelago(len(history[-1]), 0).islands
    )
    return SearchState(Archipelago(tuple(islands)), evaluations, history=points)


def test_the_course_tells_generation_speed_time_left_and_the_best_of_every_size(told):
    found = told(
        Settings(population=50, generations=20),
        *(at(0, 50, [0.25]), at(2, 150, [0.25], [0.25], [0.0625])),
    )
    # The first generation compiles, so it is not counted: 100 in 4 s, and 18 generations of 50 are left.
    assert found == [
        ("generation 0/20, 0/s", 0.0, ["  RMSE by terms  1:2 3:0.5"]),
        ("generation 2/20, 25/s, 36 s left", 0.1, ["  RMSE by terms  1:2 3:0.25"]),
    ]


def test_the_time_left_is_that_of_all_islands(told):
    states = (at(0, 150, [0.25] * 3), at(2, 450, [0.25] * 3))
    # 300 in 4 s; 18 generations of three times 50.
    assert "75/s, 36 s left" in told(Settings(population=50, generations=20, islands=3), *states)[1][0]


def test_a_search_of_no_generation_is_shown_too(told):
    assert told(Settings(generations=0), at(0, 50, [0.25]))[0][1] == 0.0


def test_every_island_is_shown_with_its_best_and_for_how_long_it_has_had_it(told):
    state = at(3, 50, [4.0, 1.0, inf], [1.0, 1.0, inf], [1.0, 1.0, inf], [0.25, 1.0, inf])
    assert told(Settings(islands=3), state)[0][2][1:] == [
        "  island   0  RMSE 0.5, for 0 generations",
        "  island   1  RMSE 1, for 3 generations",
        "  island   2  no model yet, for 3 generations",
    ]


def test_an_island_s_age_is_counted_in_generations_not_in_epochs(told):
    """Epochs have several generations; the history may begin anywhere."""
    settings = Settings(islands=2)
    state = at(20, 50, [2.25, 9.0], [1.0, 9.0], [1.0, 4.0], [1.0, 4.0])
    assert told(settings, state)[0][2][1:] == [
        "  island   0  RMSE 1, for 2 generations",
        "  island   1  RMSE 2, for 1 generations",
    ]


def test_a_single_island_is_not_listed(told):
    assert told(Settings(), at(0, 50, [0.25]))[0][2][1:] == []


def test_as_many_islands_as_are_shown_are_all_there(told):
    lines = told(Settings(islands=SHOWN), at(0, 50, [1.0] * SHOWN))[0][2][1:]
    assert [line.split()[1] for line in lines] == [str(island) for island in range(SHOWN)]


def test_of_many_islands_the_best_are_shown_in_their_order_and_the_others_counted(told):
    many = 2 * SHOWN + 3
    # From the last to the first they get worse; the first has nothing.
    least = [inf, *(float(many - island) for island in range(1, many))]
    lines = told(Settings(islands=many), at(0, 50, least))[0][2][1:]
    assert [int(line.split()[1]) for line in lines[:-1]] == list(range(many - SHOWN, many))
    assert lines[-2] == f"  island  {many - 1}  RMSE 1, for 0 generations"
    assert lines[-1] == f"  and {many - SHOWN} more, behind these"


def test_of_islands_as_good_as_each_other_the_first_are_shown(told):
    lines = told(Settings(islands=SHOWN + 1), at(0, 50, [1.0] * (SHOWN + 1)))[0][2][1:]
    assert [int(line.split()[1]) for line in lines[:-1]] == list(range(SHOWN))
    assert lines[-1] == "  and 1 more, behind these"


def test_lines_are_shown_under_the_bar_as_they_are_and_do_not_stay(monkeypatch):
    stream = StringIO()
    monkeypatch.setattr(console, "errors", Console(file=stream, force_terminal=True, width=100))
    with console.progress("identify") as tell:
        tell("generation 3", 0.5, ["island 0 [red]", "island 1"])
    shown = stream.getvalue()
    for text in ("identify", "generation 3", "island 0 [red]", "island 1"):
        assert text in shown
    assert shown.index("generation 3") < shown.index("island 0 [red]") < shown.index("island 1")
    # Cursor up and erase, for every line that was shown.
    assert shown.rindex("\x1b[2K") > shown.rindex("island 1")
