"""Correlation tests of a residual, as drawn by Billings & Voon (1986)."""

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.report.figures.style import (
    FRAME,
    MEASURED,
    REMARK,
    RESIDUAL,
    SHADE,
    SIMULATED,
    STEPS,
    blank,
    finish,
    house_style,
)
from islands.validation.residual_tests import CorrelationTest, ResidualTests

#: Tests per input, which are the panels of a row.
_COLUMNS = 4


@house_style()
def draw_residual_correlations(tests: ResidualTests, title: str = "") -> Figure:
    """Draw every correlation function of a residual with its 95 % band and its test limit.

    The first row is the autocorrelation of the residual; each following row has the four tests of an input.
    Every panel has a separate scale; that of the first ignores lag 0, whose value is always 1.

    Parameters
    ----------
    tests : ResidualTests
    title : str
        Text before the result of the tests.

    Returns
    -------
    Figure
        One axes per test, in the order of the tests.
    """
    rows = 1 + len(tests.tests[1:]) // _COLUMNS
    figure = blank(0.8 + 1.5 * rows, "\n".join(filter(None, (title, _verdict(tests)))))
    grid = figure.add_gridspec(rows, _COLUMNS)
    for position, test in enumerate(tests.tests):
        row, column = divmod(position + _COLUMNS - 1, _COLUMNS)
        axes = figure.add_subplot(grid[0, :] if position == 0 else grid[row, column])
        _draw_test(axes, test)
        if position == 0 or row == rows - 1:
            axes.set_xlabel("lag (samples)")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return finish(figure)


def _verdict(tests: ResidualTests) -> str:
    failed = sum(not test.passed for test in tests.tests)
    verdict = "passed" if tests.passed else "failed"
    p = tests.whiteness_p
    return (
        f"residual tests {verdict}: {len(tests.tests) - failed} of {len(tests.tests)} correlations passed, "
        + (f"whiteness p = {p:.2g}" if p >= 0.001 else "whiteness p < 0.001")
    )


def _draw_test(axes: Axes, test: CorrelationTest) -> None:
    axes.axhspan(-test.band, test.band, facecolor=SHADE, label="95 % band of a single lag", zorder=0.5)
    axes.axhline(test.limit, color=FRAME, lw=0.9, ls="--", label="limit of the test")
    axes.axhline(-test.limit, color=FRAME, lw=0.9, ls="--")
    axes.vlines(test.lags, 0.0, test.values, color=RESIDUAL, lw=0.8, label="correlation")
    axes.axhline(0.0, color=FRAME, lw=0.6)
    counted = np.abs(test.values[1:] if test.input is None else test.values)
    scale = 1.15 * max(test.limit, float(counted.max()))
    axes.set_ylim(-scale, scale)
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=STEPS, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=STEPS))
    axes.set_title(test.label, parse_math=True)
    axes.set_title(
        "passed" if test.passed else "FAILED",
        loc="right",
        fontsize=REMARK,
        color=MEASURED if test.passed else SIMULATED,
    )
    if test.note:
        # A white box hides nothing, because there is no correlation.
        box = {"facecolor": "white", "edgecolor": "none", "pad": 2.0}
        note = axes.text(0.5, 0.5, fill(test.note, 22), ha="center", va="center", fontsize=REMARK, bbox=box)
        note.set_transform(axes.transAxes)
