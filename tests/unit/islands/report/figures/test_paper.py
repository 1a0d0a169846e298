"""Figures of the paper: their panels, and the same lines in every theme."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.report.figures.paper import (
    Reproduced,
    draw_errors_by_switch,
    draw_shares,
    draw_training_data,
    draw_validation,
)
from islands.report.figures.themes import THEMES


@pytest.fixture(scope="module")
def reproduced():
    t = np.arange(300) / 100
    u = np.sin(2 * np.pi * t)
    return Reproduced(Dataset(u, 0.8 * u, 0.01, ("u_V",), "y_um", ("V",), "um"), 0.79 * u)


FIGURES = {
    "training": lambda shown, theme: draw_training_data(shown.record, theme),
    "validation": lambda shown, theme: draw_validation(shown, shown[100:], shown[200:], theme),
    "shares": lambda _, theme: draw_shares({"with": [([0, 1], [90.0, 100.0])], "without": []}, theme),
    "errors": lambda _, theme: draw_errors_by_switch({"all": [0.1, 0.3], "one": [0.2]}, 0.25, theme),
}


@pytest.mark.parametrize("draw", FIGURES.values(), ids=FIGURES)
def test_themes_draw_the_same_lines(reproduced, draw):
    light, dark = (draw(reproduced, theme) for theme in THEMES)
    assert light.get_facecolor() != dark.get_facecolor()
    for one, other in zip(light.axes, dark.axes, strict=True):
        for line, same in zip(one.lines, other.lines, strict=True):
            assert np.array_equal(line.get_xydata(), same.get_xydata(), equal_nan=True)


def test_a_validation_has_output_over_time_and_input_and_both_holds(reproduced):
    figure = FIGURES["validation"](reproduced, "light")
    over_time, loop, loading, unloading = figure.axes
    assert [len(axes.lines) for axes in figure.axes] == [3, 2, 3, 3]
    assert np.array_equal(loop.lines[1].get_ydata(), over_time.lines[2].get_ydata())
    assert (loading.get_xlim()[0], unloading.get_xlim()[0]) == (1.0, 2.0)
