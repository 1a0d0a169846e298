"""Hysteresis loops: output against inputs, as in Figures 5 and 7 of the paper."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.loops import loop_starts
from islands.report.figures.diverging_lines import break_line, divergence, finite_part, limits, within_reach
from islands.report.figures.downsampling import downsample
from islands.report.figures.style import (
    MEASURED,
    MEASURED_WIDTH,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    finish,
    house_style,
    label,
)
from islands.report.figures.windows import LOOPS, last_loops

#: Largest number of panels in a row.
_COLUMNS = 3


@house_style()
def draw_loop(record: Dataset, simulated: NDArray[np.float64], title: str = "") -> Figure:
    """Draw the measured and the simulated output against every input.

    Only the last five loops of a longer record are shown.

    Parameters
    ----------
    record : Dataset
    simulated : ndarray, shape (samples,)
        Simulated output, in the unit of the output; NaN if there is no prediction.
    title : str

    Returns
    -------
    Figure
        One axes per input.

    Raises
    ------
    SettingsError
        The simulation does not have one value per sample.
    """
    yhat = finite_part(record, simulated)
    rows = last_loops(record)
    shown, shown_yhat = record[rows], yhat[rows]
    columns = min(record.inputs, _COLUMNS)
    height = -(-record.inputs // columns)
    figure = blank(0.4 + (4.2 if columns == 1 else 3.4 if columns == 2 else 2.7) * height, title)
    panels = figure.subplots(height, columns, squeeze=False, sharey=True).flat
    for channel, axes in zip(range(height * columns), panels, strict=True):
        if channel < record.inputs:
            _draw_loop(axes, shown, shown_yhat, channel)
        else:
            axes.remove()
    first = figure.axes[0]
    diverged = bool(divergence(record, yhat))
    first.set_ylim(limits(shown.y, within_reach(record, shown_yhat) if diverged else shown_yhat))
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    part = f"the last {LOOPS} of {len(loop_starts(record))} loops" if shown.samples < record.samples else ""
    remark = "no simulated value" if np.isnan(yhat).all() else "the simulation diverged" if diverged else ""
    first.set_title("; ".join(filter(None, (part, remark))), fontsize=8.0)
    return finish(figure)


def draw_loop_panel(axes: Axes, record: Dataset, simulated: NDArray[np.float64]) -> None:
    """Draw the measured and the simulated output against the first input into axes.

    Parameters
    ----------
    axes : Axes
        Axes of the user; their style is kept.
    record, simulated
        As in `draw_loop`.

    Raises
    ------
    SettingsError
        The simulation does not have one value per sample.
    """
    rows = last_loops(record)
    _draw_loop(axes, record[rows], finite_part(record, simulated)[rows], 0)
    axes.legend()


def _draw_loop(axes: Axes, record: Dataset, yhat: NDArray[np.float64], channel: int) -> None:
    u = break_line(record, record.u[:, channel])
    for values, colour, width, name in (
        (record.y, MEASURED, 0.8 * MEASURED_WIDTH, "measured"),
        (yhat, SIMULATED, SIMULATED_WIDTH, "simulated"),
    ):
        axes.plot(*downsample(u, break_line(record, values)), color=colour, lw=width, label=name)
    axes.set_xlabel(label(record.input_names[channel], record.input_units[channel]))
    if channel % _COLUMNS == 0:
        axes.set_ylabel(label(record.output_name, record.output_unit))
