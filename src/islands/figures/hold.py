"""The output while the input rests: what Property 1 of the paper (section 3) asks a hysteresis model for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.figures.diverging_lines import annotate_divergence, limits, within_reach
from islands.figures.downsampling import thin
from islands.figures.style import FRAME, blank, finish, house_style, label
from islands.model.model import Model
from islands.validation.physics import LEVELS, hold_response, percent_of_range

#: From the lowest level to the highest, darker to lighter: apart for colour-blind eyes and in grey print.
_COLOURS = ("#440154", "#3b528b", "#21918c", "#4cb04f", "#c2a500")


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """One hold: time from its first sample in seconds, input as a share of its amplitude, output."""

    time: NDArray[np.float64]
    input: NDArray[np.float64]
    output: NDArray[np.float64]
    drift_percent: float

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where there is an output: all of it, or all up to a divergence."""
        return ~np.isnan(self.output)


@house_style()
def draw_holds(model: Model, record: Dataset, title: str = "") -> Figure:
    """Draw the output while the input is held at five levels, reached while loading and while unloading.

    Time counts from the first sample at rest; before it stands the approach. Each side says its largest
    drift, as `Hold` defines it, in per cent of the record's output range, and how many holds diverged. The
    axis follows a diverging output one range beyond the record's.

    Parameters
    ----------
    model : Model
        With parameters.
    record : Dataset
        Complete; it gives ranges, rate, bound, and an output to start from.
    title : str

    Returns
    -------
    Figure
        Four axes: the input while loading and unloading, the output under each.
    """
    figure = blank(5.0, title)
    axes = figure.subplots(2, 2, width_ratios=(1, 2.6), sharex="col", sharey="col")
    sides = {
        words: [_held(model, record, level, loading) for level in LEVELS]
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
        _draw(left, right, side)
        left.set_title(f"input, {words}")
        right.set_title(_drift(f"after {words}", side))
        right.set_ylabel(label(record.output_name, record.output_unit))
        _name_inputs(left, record)
    for panel in axes[1]:
        panel.set_xlabel("time from the start of the hold (s)")
    return finish(figure)


def _held(model: Model, record: Dataset, level: float, loading: bool) -> _Held:
    u, y = hold_response(model, record, level, loading)
    begin = int(np.flatnonzero(u != u[-1])[-1]) + 1
    # As the physics check: from where every lag of the input has its level.
    drift = percent_of_range(y[-1] - y[begin + model.maximum_lag], record.output_range)
    time = record.dt * np.arange(-begin, len(u) - begin, dtype=np.float64)
    return _Held(time, u, y, drift)


def _drift(words: str, side: Sequence[_Held]) -> str:
    drifts = [held.drift_percent for held in side if held.known.all()]
    lost = f"{words}: {len(side) - len(drifts)} of {len(side)} diverged"
    if not drifts:
        return lost
    largest = max(drifts)
    share = "below 0.01" if largest < 0.01 else f"{largest:.2f}" if largest < 10 else f"{largest:.0f}"
    drift = f"{share} % of the output range"
    if len(drifts) == len(side):
        return f"{words}: largest drift {drift}"
    return f"{lost},\nlargest drift of the others {drift}"


def _draw(left: Axes, right: Axes, side: Sequence[_Held]) -> None:
    for held, colour in zip(side, _COLOURS, strict=True):
        left.plot(*thin(held.time, held.input), color=colour, lw=1.0)
        at_rest = held.time >= 0
        for part, shade, width in ((~at_rest, FRAME, 0.5), (at_rest, colour, 1.4)):
            right.plot(*thin(held.time[part], held.output[part]), color=shade, lw=width)
    for axes in (left, right):
        axes.axvline(0.0, color=FRAME, lw=0.6)
    lost = [held for held in side if not held.known.all()]
    annotate_divergence(right, [(held.time[held.known], held.output[held.known]) for held in lost])


def _name_inputs(axes: Axes, record: Dataset) -> None:
    """Put the five levels on the input's axis: in its unit, or as shares where several inputs move."""
    middle, amplitude = (record.u.max(axis=0) + record.u.min(axis=0)) / 2, np.ptp(record.u, axis=0) / 2
    axes.set_ylim(-1.1, 1.1)
    if record.inputs == 1:
        levels = middle[0] + amplitude[0] * np.array(LEVELS)
        axes.set_yticks(LEVELS, [f"{value:.3g}".replace("-", "−") for value in levels])
        axes.set_ylabel(label(record.input_names[0], record.input_units[0]))
    else:
        axes.set_yticks(LEVELS)
        axes.set_ylabel("inputs / amplitude")
