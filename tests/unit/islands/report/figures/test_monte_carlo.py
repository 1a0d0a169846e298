"""Figures of Monte Carlo runs: boxes, counts with intervals, and a scan."""

from math import inf

import numpy as np
import pytest

from islands.report.figures.monte_carlo import MonteCarloGroup, ScanLine, draw_groups, draw_scan
from islands.report.figures.themes import THEMES

pytestmark = pytest.mark.ci


def make_group(label, diverged=0, **changes):
    errors = list(np.linspace(1.0, 3.0, 10))
    simulation = [inf] * diverged + errors[diverged:]
    return MonteCarloGroup(label, errors, simulation, range(3, 13), 0.1 * diverged, (0.0, 0.9), **changes)


def boxes(axes):
    return [patch for patch in axes.patches if type(patch).__name__ == "PathPatch"]


def medians(axes):
    return [line.get_ydata()[0] for line in axes.lines if len(line.get_ydata()) == 2 and line.get_lw() == 1.2]


@pytest.mark.parametrize("theme", THEMES)
def test_errors_have_a_box_for_each_group_and_kind(theme):
    figure = draw_groups([("S1", [make_group("0", diverged=4), make_group("1")])], "PRPB", theme)
    errors, counts, sizes = figure.axes
    assert (len(boxes(errors)), len(boxes(sizes))) == (4, 2)
    assert errors.get_yscale() == "log"
    # The order is PE of both groups, then SE; the median of six stable runs is that of the last six.
    expected = [2.0, 2.0, np.median(np.linspace(1.0, 3.0, 10)[4:]), 2.0]
    assert medians(errors) == pytest.approx(expected)
    assert [text.get_text() for text in sizes.get_xticklabels()] == ["0", "1"]
    assert counts.get_ylabel() == "unstable"
    ticks = [text.get_text() for text in (*errors.get_yticklabels(), *errors.get_yticklabels(minor=True))]
    assert not any("mathdefault" in text for text in ticks)


def test_groups_without_a_stable_model_have_no_box_of_the_free_run():
    figure = draw_groups([("S2", [make_group("0", diverged=10), make_group("1")])], "PRPB", "light")
    assert len(boxes(figure.axes[0])) == 3


def test_published_fractions_are_marked_where_there_are_any():
    panels = [
        ("S1", [make_group("0", diverged=4, published=0.4), make_group("1")]),
        ("S2", [make_group("0")]),
    ]
    figure = draw_groups(panels, "PRPB", "light")
    legends = [
        [text.get_text() for text in axes.get_legend().get_texts()]
        for axes in figure.axes
        if axes.get_ylim()[1] == 1.05
    ]
    assert [("published" in names) for names in legends] == [True, False]


def test_scan_marks_the_largest_likelihood():
    lines = [ScanLine("S1", [0.9, 0.4, 0.0], [(0.6, 1.0), (0.2, 0.7), (0.0, 0.3)], 0.4)]
    sizes = ("PRPB 1", [[6, 7], [5, 6, 6], [4]], (5.0, 8.0))
    figure = draw_scan((0.01, 0.03, 0.035), lines, sizes, (-9.0, -2.0, -30.0), "variance", "dark")
    counts, terms, likelihood = figure.axes
    assert list(likelihood.lines[-1].get_xdata()) == [0.03]
    labels = [text.get_text() for text in likelihood.get_xticklabels()]
    assert labels == ["0.01", "0.03"]  # labels that are close to each other are left out
    for axes, (low, high) in ((counts, (0.2, 0.7)), (terms, (5.0, 6.0))):
        (bars,) = (found for found in axes.collections if type(found).__name__ == "LineCollection")
        assert bars.get_segments()[1][:, 1] == pytest.approx((low, high))
