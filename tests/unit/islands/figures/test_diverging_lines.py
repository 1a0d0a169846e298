"""What of a simulation is drawn, how far the axes follow it, and where it is said to have diverged."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.errors import SettingsError
from islands.figures.diverging_lines import (
    annotate_divergence,
    break_line,
    divergence,
    finite_part,
    limits,
    within_reach,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NAN = np.nan


def record(y: list[float], **changes: object) -> Dataset:
    return Dataset(np.arange(len(y), dtype=float), np.array(y), 0.1, **changes)


def test_what_is_infinite_or_beyond_the_bound_is_not_drawn():
    made = finite_part(record([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([1.0, np.inf, NAN, -1e7, 1e305]))
    np.testing.assert_array_equal(made, [1.0, NAN, NAN, NAN, NAN])


def test_a_simulation_of_another_length_is_refused():
    with pytest.raises(SettingsError, match=r"each of the record's 3 samples, got shape \(2,\)"):
        finite_part(record([0.0, 1.0, 2.0]), np.zeros(2))


def test_a_line_is_broken_between_segments_alone():
    made = break_line(record([1.0, 2.0, 3.0, 4.0, 5.0], segments=(2, 2, 1)), np.arange(5.0))
    np.testing.assert_array_equal(made, [0.0, 1.0, NAN, 2.0, 3.0, NAN, 4.0])
    np.testing.assert_array_equal(break_line(record([1.0, 2.0]), np.arange(2.0)), [0.0, 1.0])


def test_an_axis_follows_one_range_beyond_the_measured_output():
    made = within_reach(record([1.0, NAN, 3.0]), np.array([-1e5, 0.0, 2.5, 1e5, NAN]))
    np.testing.assert_array_equal(made, [-1.0, 0.0, 2.5, 5.0, NAN])


def test_without_a_measured_output_an_axis_follows_the_simulation():
    values = np.array([-1e5, 1e5])
    np.testing.assert_array_equal(within_reach(record([NAN, NAN]), values), values)


def test_limits_leave_a_margin_around_all_values_that_are_there():
    assert limits(np.array([0.0, NAN]), np.array([10.0])) == pytest.approx((-0.5, 10.5))


@pytest.mark.parametrize(
    ("values", "expected"), [([0.0], (-1.0, 1.0)), ([5.0, 5.0], (4.75, 5.25)), ([NAN, NAN], (-1.0, 1.0))]
)
def test_limits_of_a_constant_or_of_nothing_are_apart(values, expected):
    assert limits(np.array(values)) == pytest.approx(expected)


def test_a_divergence_is_a_simulation_that_ends_before_its_segment():
    simulated = np.array([NAN, 1.0, 2.0, NAN, NAN, 1.0, NAN, 3.0, NAN, NAN])
    found = divergence(record([0.0] * 9 + [1.0], segments=(4, 4, 2)), simulated)
    assert found == [(slice(0, 4), 2)]


def lost(*lines: tuple[list[float], list[float]]) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 10.0))
    annotate_divergence(axes, [(np.array(x), np.array(y)) for x, y in lines])
    return figure


def marks(figure: "Figure") -> list[tuple[float, float]]:
    return [(line.get_xdata()[0], line.get_ydata()[0]) for line in figure.axes[0].lines]


def words(figure: "Figure") -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def test_the_mark_stands_where_the_line_leaves_the_axes_for_good():
    figure = lost(([1.0, 2.0, 3.0, 4.0, 5.0], [5.0, 20.0, 5.0, 30.0, -900.0]))
    assert marks(figure) == [(4.0, 10.0)]
    assert words(figure) == ["diverged"]


def test_the_mark_stands_at_the_end_of_a_line_that_jumps_out():
    assert marks(lost(([1.0, 2.0], [5.0, 6.0]))) == [(2.0, 6.0)]


def test_the_word_is_written_once_where_several_lines_diverge():
    figure = lost(([10.0], [5.0]), ([11.0], [6.0]), ([60.0], [5.0]))
    assert len(marks(figure)) == 3
    assert words(figure) == ["diverged", "diverged"]


def test_the_word_stays_inside_at_the_right_edge():
    assert lost(([10.0], [5.0])).axes[0].texts[0].get_ha() == "left"
    assert lost(([95.0], [5.0])).axes[0].texts[0].get_ha() == "right"


def test_a_line_without_a_sample_has_no_mark():
    assert marks(lost(([], []))) == []
