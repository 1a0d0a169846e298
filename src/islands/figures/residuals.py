"""The correlation tests of a residual, as Billings & Voon (1986) draw them."""

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from islands.figures.style import (
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

#: Tests of one input: a row of panels.
_ROW = 4


@house_style()
def draw_residual_correlations(tests: ResidualTests, title: str = "") -> Figure:
    """Draw every correlation function of a residual with its 95 % band and the limit that decides.

    The residual's own correlation has the first row for itself, the four tests of each input a row below.
    Each panel has a scale of its own; lag 0 of the first, 1 for every residual, runs out of it.

    Parameters
    ----------
    tests : ResidualTests
    title : str
        Stands before the verdict.

    Returns
    -------
    Figure
        One axes for each test, in their order.
    """
    rows = 1 + len(tests.tests[1:]) // _ROW
    figure = blank(0.8 + 1.5 * rows, "\n".join(filter(None, (title, _verdict(tests)))))
    grid = figure.add_gridspec(rows, _ROW)
    for position, test in enumerate(tests.tests):
        row, column = divmod(position + _ROW - 1, _ROW)
        axes = figure.add_subplot(grid[0, :] if position == 0 else grid[row, column])
        _draw(axes, test)
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


def _draw(axes: Axes, test: CorrelationTest) -> None:
    axes.axhspan(-test.band, test.band, facecolor=SHADE, label="95 % band of a single lag", zorder=0.5)
    axes.axhline(test.limit, color=FRAME, lw=0.9, ls="--", label="limit that decides")
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
        # On white, since there is no correlation that it could hide.
        box = {"facecolor": "white", "edgecolor": "none", "pad": 2.0}
        note = axes.text(0.5, 0.5, fill(test.note, 22), ha="center", va="center", fontsize=REMARK, bbox=box)
        note.set_transform(axes.transAxes)
