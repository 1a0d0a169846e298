"""Figure of the free runs of several models."""

import numpy as np

from islands.report.figures.comparison import RUN_STYLES, draw_comparison
from islands.report.figures.style import MEASURED
from support.undrawn import undrawn_figures

TIME = np.linspace(0.0, 1.0, 200)
MEASURED_OUTPUT = np.sin(6.0 * TIME)


def draw(runs, **options):
    styles = dict(zip(runs, RUN_STYLES, strict=False))
    with undrawn_figures():
        return draw_comparison(TIME, MEASURED_OUTPUT, runs, ("y_um", "um"), styles, **options)


def test_every_run_has_a_line_and_a_residual_in_its_style():
    runs = {"A": MEASURED_OUTPUT + 0.1, "B": MEASURED_OUTPUT - 0.2}
    above, below = draw(runs).axes
    measured, *lines = above.lines
    assert measured.get_color() == MEASURED
    for line, residual, (name, run), (colour, _) in zip(
        lines, below.lines[1:], runs.items(), RUN_STYLES, strict=False
    ):
        assert (line.get_label(), line.get_color(), residual.get_color()) == (name, colour, colour)
        np.testing.assert_array_equal(line.get_ydata(), run)
        np.testing.assert_array_equal(residual.get_ydata(), MEASURED_OUTPUT - run)
    assert len(draw(runs, residuals=False).axes) == 1
