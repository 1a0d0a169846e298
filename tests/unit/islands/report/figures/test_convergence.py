"""Figures of a search: convergence, islands, and error by size."""

from types import SimpleNamespace

import numpy as np

from islands.evolution.search_state import HistoryPoint
from islands.report.figures.convergence import draw_convergence, draw_front, draw_islands


def make_result(history=(), models=()):
    """Return a stub of a result with the attributes that the figures read."""
    entries = tuple(
        SimpleNamespace(
            model=SimpleNamespace(free_size=size),
            metrics={
                part: {"free_run": SimpleNamespace(mape=error)}
                for part, error in (("estimation", estimation), ("validation", validation))
            },
        )
        for size, estimation, validation in models
    )
    search = SimpleNamespace(history=tuple(history))
    return SimpleNamespace(search=search, models=entries, recommended=entries[-1] if entries else None)


#: Two sizes from the start, a third from generation 2 on; squared errors.
HISTORY = (
    HistoryPoint(0, 10, {1: 4.0, 3: 0.04}, (0.04,)),
    HistoryPoint(1, 20, {1: 4.0, 3: 0.01}, (0.01,)),
    HistoryPoint(2, 30, {1: 1.0, 2: 0.09, 3: 0.01}, (0.01,)),
)

#: Three islands; the last one has a model from generation 1 on.
ISLANDS_HISTORY = (
    HistoryPoint(4, 10, {1: 4.0}, (4.0, 9.0, np.inf)),
    HistoryPoint(5, 20, {1: 1.0}, (4.0, 1.0, 16.0)),
    HistoryPoint(6, 30, {1: 0.25}, (0.25, 1.0, 16.0)),
)
MODELS = ((3, 0.2, 0.3), (1, 20.0, 30.0), (2, 2.0, 1.0))


def get_axes(figure):
    (axes,) = figure.axes
    return axes


def get_lines(figure):
    return {line.get_label(): line.get_xydata().tolist() for line in get_axes(figure).lines}


def integer_ticks(axes):
    low, high = axes.get_xlim()
    shown = [tick for tick in axes.get_xticks() if low <= tick <= high]
    assert shown
    assert all(tick == int(tick) for tick in shown)
    return shown


def test_convergence_shows_the_rmse_of_every_size_over_generations():
    figure = draw_convergence(make_result(HISTORY))
    assert get_lines(figure) == {
        "1": [[0.0, 2.0], [1.0, 2.0], [2.0, 1.0]],
        "2": [[2.0, 0.3]],
        "3": [[0.0, 0.2], [1.0, 0.1], [2.0, 0.1]],
    }
    axes = get_axes(figure)
    assert axes.get_yscale() == "log"
    assert integer_ticks(axes) == [0, 1, 2]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["1", "2", "3"]


def test_front_shows_both_parts_over_the_number_of_terms():
    figure = draw_front(make_result(models=MODELS))
    assert get_lines(figure) == {
        "estimation": [[1.0, 20.0], [2.0, 2.0], [3.0, 0.2]],
        "validation": [[1.0, 30.0], [2.0, 1.0], [3.0, 0.3]],
        "recommended": [[2.0, 1.0]],
    }
    assert integer_ticks(get_axes(figure)) == [1, 2, 3]


def test_islands_figure_has_a_line_per_island_and_one_for_the_best():
    figure = draw_islands(make_result(ISLANDS_HISTORY))
    *islands, best = (line.get_xydata() for line in get_axes(figure).lines)
    expected = [[2.0, 2.0, 0.5], [3.0, 1.0, 1.0], [np.nan, 4.0, 4.0]]
    assert len(islands) == 3
    for line, errors in zip([*islands, best], [*expected, [2.0, 1.0, 0.5]], strict=True):
        assert line[:, 0].tolist() == [4.0, 5.0, 6.0]
        np.testing.assert_array_equal(line[:, 1], errors)
    axes = get_axes(figure)
    assert axes.get_yscale() == "log"
    assert integer_ticks(axes) == [4, 5, 6]
    # One legend entry is enough for all islands.
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["one island", "best island"]
