"""Figures of models of hysteresis: output against inputs (Figures 5 and 7 of the paper), and holds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.models.protocol import DynamicModel
from islands.records.dataset import Dataset
from islands.records.loops import loop_starts
from islands.report.figures.lines import (
    LOOPS,
    annotate_divergence,
    break_line,
    divergence,
    downsample,
    finite_part,
    last_loops,
    limits,
    within_reach,
)
from islands.report.figures.style import (
    FRAME,
    MEASURED,
    MEASURED_WIDTH,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    finish,
    house_style,
    label,
)
from islands.validation.physics import LEVELS, hold_response, percent_of_range

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


#: Colours of the levels from lowest to highest, distinguishable for colour-blind readers and in grey print.
_COLOURS = ("#440154", "#3b528b", "#21918c", "#3d9a40", "#a68c00")


@dataclass(frozen=True, slots=True, eq=False)
class _Hold:
    """One hold: time from its first sample in seconds, input as a fraction of its amplitude, output."""

    time: NDArray[np.float64]
    input: NDArray[np.float64]
    output: NDArray[np.float64]
    drift_percent: float

    @property
    def known(self) -> NDArray[np.bool_]:
        """Whether each sample has an output; false after a divergence."""
        return ~np.isnan(self.output)


@house_style()
def draw_holds(model: DynamicModel, record: Dataset, title: str = "") -> Figure:
    """Draw the output while the input is held at five levels, reached while loading and while unloading.

    Time 0 is the first sample of the hold; negative times show the approach. The title of each side gives
    the largest change of the output, which is the drift of `HoldTest`, in percent of the output range of the
    record, and the number of diverged holds. A model without hysteresis changes until it has settled. The
    axis limits follow a diverging output up to one output range beyond the record.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    record : Dataset
        Record without missing values; defines ranges, sampling rate, divergence bound and initial output.
    title : str

    Returns
    -------
    Figure
        Four axes: input and output, during loading above and unloading below.
    """
    figure = blank(5.0, title)
    axes = figure.subplots(2, 2, width_ratios=(1, 2.6), sharex="col", sharey="col")
    sides = {
        words: [_simulate_hold(model, record, level, loading) for level in LEVELS]
        for loading, words in ((True, "loading"), (False, "unloading"))
    }
    outputs = [
        held.output if held.known.all() else within_reach(record, held.output)
        for side in sides.values()
        for held in side
    ]
    begin, end = (min(held.time[at] for side in sides.values() for held in side) for at in (0, -1))
    axes[0, 0].set_xlim(begin, -begin / 2)
    axes[0, 1].set(xlim=(begin, end), ylim=limits(*outputs))
    for (words, side), (left, right) in zip(sides.items(), axes, strict=True):
        _draw_side(left, right, side)
        left.set_title(f"input, {words}")
        right.set_title(_describe_change(f"after {words}", side))
        right.set_ylabel(label(record.output_name, record.output_unit))
        _label_input_axis(left, record)
    for panel in axes[1]:
        panel.set_xlabel("time from the start of the hold (s)")
    return finish(figure)


def _simulate_hold(model: DynamicModel, record: Dataset, level: float, loading: bool) -> _Hold:
    u, y = hold_response(model, record, level, loading)
    begin = int(np.flatnonzero(u != u[-1])[-1]) + 1
    # As in the physics check, start when every lag of the input has reached the level.
    drift = percent_of_range(y[-1] - y[begin + model.maximum_lag], record.output_range)
    time = record.dt * np.arange(-begin, len(u) - begin, dtype=np.float64)
    return _Hold(time, u, y, drift)


def _describe_change(words: str, side: Sequence[_Hold]) -> str:
    drifts = [held.drift_percent for held in side if held.known.all()]
    lost = f"{words}: {len(side) - len(drifts)} of {len(side)} diverged"
    if not drifts:
        return lost
    largest = max(drifts)
    share = "below 0.01" if largest < 0.01 else f"{largest:.2f}" if largest < 10 else f"{largest:.0f}"
    change = f"{share} % of the output range"
    if len(drifts) == len(side):
        return f"{words}: largest change {change}"
    return f"{lost},\nlargest change of the others {change}"


def _draw_side(left: Axes, right: Axes, side: Sequence[_Hold]) -> None:
    for level, held, colour in zip(LEVELS, side, _COLOURS, strict=True):
        name = f"held at {level:g}"
        left.plot(*downsample(held.time, held.input), color=colour, lw=1.0, label=name)
        at_rest = held.time >= 0
        for part, shade, width in ((~at_rest, FRAME, 0.5), (at_rest, colour, 1.4)):
            right.plot(*downsample(held.time[part], held.output[part]), color=shade, lw=width, label=name)
    for axes in (left, right):
        axes.axvline(0.0, color=FRAME, lw=0.6)
    lost = [held for held in side if not held.known.all()]
    annotate_divergence(right, [(held.time[held.known], held.output[held.known]) for held in lost])


def _label_input_axis(axes: Axes, record: Dataset) -> None:
    """Label the five levels on the input axis, in its unit or, for several inputs, as fractions."""
    middle, amplitude = (record.u.max(axis=0) + record.u.min(axis=0)) / 2, np.ptp(record.u, axis=0) / 2
    axes.set_ylim(-1.1, 1.1)
    if record.inputs == 1:
        levels = middle[0] + amplitude[0] * np.array(LEVELS)
        axes.set_yticks(LEVELS, [f"{value:.3g}".replace("-", "−") for value in levels])
        axes.set_ylabel(label(record.input_names[0], record.input_units[0]))
    else:
        axes.set_yticks(LEVELS)
        axes.set_ylabel("inputs / amplitude")
