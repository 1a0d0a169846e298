"""Lines of simulations that may diverge: finite part, axis limits and annotations."""

from typing import TYPE_CHECKING

import numpy as np

from islands.records.dataset import Dataset
from islands.report.figures.diverging_lines import (
    annotate_divergence,
    divergence,
    finite_part,
    within_reach,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NAN = np.nan


def record(y: list[float], **changes: object) -> Dataset:
    return Dataset(np.arange(len(y), dtype=float), np.array(y), 0.1, **changes)


def test_values_that_are_infinite_or_beyond_the_bound_are_not_drawn():
    made = finite_part(record([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([1.0, np.inf, NAN, -1e7, 1e305]))
    np.testing.assert_array_equal(made, [1.0, NAN, NAN, NAN, NAN])


def test_axis_follows_the_simulation_without_measured_output():
    values = np.array([-1e5, 1e5])
    np.testing.assert_array_equal(within_reach(record([NAN, NAN]), values), values)


def test_divergence_is_a_simulation_that_ends_before_its_segment():
    simulated = np.array([NAN, 1.0, 2.0, NAN, NAN, 1.0, NAN, 3.0, NAN, NAN])
    found = divergence(record([0.0] * 9 + [1.0], segments=(4, 4, 2)), simulated)
    assert found == [(slice(0, 4), 2)]


def draw_diverging(*lines: tuple[list[float], list[float]]) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 10.0))
    annotate_divergence(axes, [(np.array(x), np.array(y)) for x, y in lines])
    return figure


def marks(figure: "Figure") -> list[tuple[float, float]]:
    return [(line.get_xdata()[0], line.get_ydata()[0]) for line in figure.axes[0].lines]


def annotations(figure: "Figure") -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def test_mark_is_where_the_line_finally_leaves_the_axes():
    figure = draw_diverging(([1.0, 2.0, 3.0, 4.0, 5.0], [5.0, 20.0, 5.0, 30.0, -900.0]))
    assert marks(figure) == [(4.0, 10.0)]
    assert annotations(figure) == ["diverged"]
