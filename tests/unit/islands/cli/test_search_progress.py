"""Progress display of a search."""

from dataclasses import replace
from io import StringIO
from math import inf

import pytest
from rich.console import Console

from islands.cli import progress_display
from islands.cli import search_progress as showing
from islands.cli.search_progress import SearchDisplay
from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.evolution.settings import Settings


@pytest.fixture
def displayed(monkeypatch):
    """Return a function that shows states, four seconds apart, and returns the displayed texts."""

    def show(settings, *states):
        found, clock = [], [100.0]
        monkeypatch.setattr(showing, "monotonic", lambda: clock[0])
        search = SearchDisplay(
            lambda text, share, lines=None, left=None: found.append((text, share, lines, left)),
            *("narx", 1000, settings),
        )
        for state in states:
            search.show_epoch(state, settings)
            clock[0] += 4.0
        found = [each for each in found if each[2] is not None]
        return found

    return show


def at(generation, evaluations, *history):
    """Return a state whose history contains the best fitness of every island in past generations."""
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


def test_each_island_has_its_best_error_and_its_age(displayed):
    state = at(3, 50, [4.0, 1.0, inf], [1.0, 1.0, inf], [1.0, 1.0, inf], [0.25, 1.0, inf])
    assert displayed(Settings(islands=3), state)[0][2][1:] == [
        "  island   0  RMSE 0.5, for 0 generations",
        "  island   1  RMSE 1, for 3 generations",
        "  island   2  no model yet, for 3 generations",
    ]


def test_lines_below_the_bar_are_verbatim_and_erased_at_the_end(monkeypatch):
    stream = StringIO()
    monkeypatch.setattr(progress_display, "errors", Console(file=stream, force_terminal=True, width=100))
    with progress_display.progress("identify") as show:
        show("generation 3", 0.5, ["island 0 [red]", "island 1"])
    shown = stream.getvalue()
    for text in ("identify", "generation 3", "island 0 [red]", "island 1"):
        assert text in shown
    assert shown.index("generation 3") < shown.index("island 0 [red]") < shown.index("island 1")
    # Each line is erased at the end (cursor up, erase).
    assert shown.rindex("\x1b[2K") > shown.rindex("island 1")
