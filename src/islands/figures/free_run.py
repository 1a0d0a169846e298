"""Measured and simulated output over time, and what is left between them."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.figures.diverging_lines import (
    annotate_divergence,
    break_line,
    divergence,
    finite_part,
    limits,
    within_reach,
)
from islands.figures.downsampling import thin
from islands.figures.style import (
    FRAME,
    MEASURED,
    MEASURED_WIDTH,
    RESIDUAL,
    SHADE,
    SIMULATED,
    SIMULATED_WIDTH,
    STEPS,
    blank,
    finish,
    house_style,
    label,
)
from islands.figures.windows import representative_window
from islands.validation.metrics import metrics

_TYPICAL = ", whose mean absolute residual is the median of all such stretches"


@house_style()
def draw_free_run(record: Dataset, simulated: NDArray[np.float64], title: str = "") -> Figure:
    """Draw the output of a free run over the measured one, and the residual under it on a scale of its own.

    A record of more than 20 loops is shown as a whole and, below, in a stretch whose residual is the median
    of all such stretches. Segments are separated by thin vertical lines, missing values stay open. An axis
    follows a diverging simulation one range beyond the measured output, and the figure says where it left.

    Parameters
    ----------
    record : Dataset
    simulated : ndarray, shape (samples,)
        NaN where there is no prediction; in the unit of the output.
    title : str

    Returns
    -------
    Figure
        Two axes, output and residual; or four, the stretch's below those of the whole.

    Raises
    ------
    SettingsError
        The simulation has not one value for every sample.
    """
    yhat = finite_part(record, simulated)
    stretch = representative_window(record, record.y - yhat)
    if stretch is None:
        figure = blank(4.2, title)
        axes = figure.subplots(2, 1, height_ratios=(2, 1))
        _pair(axes[0], axes[1], record, yhat, 1.0)
    else:
        figure = blank(7.2, title)
        axes = figure.subplots(4, 1, height_ratios=(2, 1, 2.4, 1.2))
        _pair(axes[0], axes[1], record, yhat, 0.6)
        _pair(axes[2], axes[3], record[stretch], yhat[stretch], 1.0)
        _mark(axes[:2], record[stretch])
        complete = not np.isnan((record.y - yhat)[stretch]).any()
        axes[2].set_title("the shaded stretch" + (_TYPICAL if complete else ""), fontsize=8.0)
    if np.isnan(yhat).all():
        axes[0].set_title("no simulated value", color=SIMULATED)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    axes[1].set_title(_errors(record, yhat), loc="right", fontsize=8.0)
    figure.align_ylabels()
    return finish(figure)


def _pair(above: Axes, below: Axes, record: Dataset, yhat: NDArray[np.float64], weight: float) -> None:
    time = break_line(record, record.time)
    measured, simulated = break_line(record, record.y), break_line(record, yhat)
    residual = measured - simulated
    followed = break_line(record, _followed(record, yhat))
    above.plot(*thin(time, measured), color=MEASURED, lw=weight * MEASURED_WIDTH, label="measured")
    above.plot(*thin(time, simulated), color=SIMULATED, lw=weight * SIMULATED_WIDTH, label="simulated")
    above.set_ylim(limits(measured, followed))
    below.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    below.plot(*thin(time, residual), color=RESIDUAL, lw=weight * SIMULATED_WIDTH, label="residual")
    below.set_ylim(limits(measured - followed, np.zeros(1)))
    below.yaxis.set_major_locator(MaxNLocator(4, steps=STEPS))
    for axes in (above, below):
        axes.set_xlim(record.time[0], record.time[-1] + (record.dt if record.samples == 1 else 0.0))
        for _, end in record.bounds[:-1]:
            axes.axvline(record.time[end] - record.dt / 2, color=FRAME, lw=0.6)
    above.tick_params(labelbottom=False)
    above.set_ylabel(label(record.output_name, record.output_unit))
    below.set(xlabel="time (s)", ylabel=label("residual", record.output_unit))
    _remark(above, record, yhat)


def _followed(record: Dataset, yhat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what of a simulation the axes follow: all of it, but a diverging segment within reach alone."""
    followed = yhat.copy()
    for segment, _ in divergence(record, yhat):
        followed[segment] = within_reach(record, yhat[segment])
    return followed


def _remark(axes: Axes, record: Dataset, yhat: NDArray[np.float64]) -> None:
    lines = []
    for segment, last in divergence(record, yhat):
        there = segment.start + np.flatnonzero(~np.isnan(yhat[segment.start : last + 1]))
        lines.append((record.time[there], yhat[there]))
    annotate_divergence(axes, lines)


def _mark(whole: NDArray[np.object_], stretch: Dataset) -> None:
    for axes in whole:
        axes.axvspan(stretch.time[0], stretch.time[-1], facecolor=SHADE, edgecolor=FRAME, lw=0.6, zorder=0.5)


def _errors(record: Dataset, yhat: NDArray[np.float64]) -> str:
    """Return the errors of the whole record in words; nothing after a divergence."""
    found = metrics(record.y, yhat)
    if divergence(record, yhat) or np.isnan(found.mape):
        return ""
    mape, rmse = (f"{value:#.3g}".removesuffix(".") for value in (found.mape, found.rmse))
    return f"MAPE {mape} % of the range, RMSE {rmse} {record.output_unit}".rstrip()
