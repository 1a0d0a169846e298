"""Lines of figures: divergence, parts of long records, and downsampling."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.report.figures.lines import (
    LOOPS,
    VERTICES,
    annotate_divergence,
    divergence,
    downsample,
    finite_part,
    last_loops,
    representative_window,
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


def sine(periods: int, length: int = 100, **changes: object) -> Dataset:
    k = np.arange(periods * length)
    u = np.sin(2 * np.pi * k / length - 0.5)
    return Dataset(u, 2 * u, 0.01, **changes)


def test_last_loops_are_complete_periods_at_the_end():
    rows = last_loops(sine(40))
    assert rows.stop - rows.start == 100 * LOOPS + 1
    assert rows.stop > 3900


def test_section_has_the_median_residual():
    record = sine(25)
    residual = np.repeat([5.0, 1.0, 4.0, 3.0, 2.0], 500)
    assert representative_window(record, residual) == slice(1500, 2000)


LONG = 100_000


def noise(samples: int = LONG) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(samples, dtype=float), np.random.default_rng(0).standard_normal(samples)


@pytest.mark.parametrize("samples", [VERTICES + 1, 3001, 99_999, LONG])
def test_long_line_keeps_at_most_the_requested_vertices(samples):
    kept = len(downsample(*noise(samples))[0])
    assert VERTICES / 2 < kept <= VERTICES


@pytest.mark.parametrize("sample", [0, 1, 199, 200, 54_321, LONG - 1])
@pytest.mark.parametrize("height", [50.0, -50.0])
def test_spike_of_a_single_sample_is_kept(sample, height):
    x, y = noise()
    y[sample] = height
    kept_x, kept_y = downsample(x, y)
    assert kept_y[kept_x == sample].tolist() == [height]


@pytest.mark.parametrize("gap", [slice(500, 501), slice(30_000, 40_000), slice(199, 201), slice(0, 250)])
def test_gap_stays_open(gap):
    x, y = noise()
    y[gap] = np.nan
    kept_x, kept_y = downsample(x, y)
    inside = (kept_x >= gap.start) & (kept_x < gap.stop)
    assert inside.any()
    assert np.isnan(kept_y[inside]).all()
    assert not np.isnan(kept_y[~inside]).any()
