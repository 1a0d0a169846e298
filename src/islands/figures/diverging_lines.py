"""The lines of a record: what of a simulation can be drawn, how far an axis follows it, and its words."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import SettingsError
from islands.figures.style import REMARK, SIMULATED
from islands.simulation.predictors import divergence_bound

#: Two remarks on one axis stand at least this share of its width apart.
_APART = 0.12


def finite_part(record: Dataset, simulated: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a simulation with NaN in place of what is infinite or beyond the bound of a divergence.

    Raises
    ------
    SettingsError
        It has not one value for every sample.
    """
    values = np.array(simulated, dtype=np.float64)
    if values.shape != (record.samples,):
        raise SettingsError(
            f"a simulation has one value for each of the record's {record.samples} samples, "
            f"got shape {values.shape}"
        )
    values[~(np.abs(values) <= divergence_bound(record))] = np.nan
    return values


def break_line(record: Dataset, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values of every sample with a NaN between segments: no line leads from one to the next."""
    return np.insert(values, [end for _, end in record.bounds[:-1]], np.nan)


def within_reach(record: Dataset, simulated: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values clipped to one range beyond the measured output: so far an axis follows a divergence."""
    known = record.y[~np.isnan(record.y)]
    if not known.size:
        return simulated
    span = float(np.ptp(known)) or float(abs(known[0])) or 1.0
    return np.clip(simulated, known.min() - span, known.max() + span)


def limits(*lines: NDArray[np.float64]) -> tuple[float, float]:
    """Return axis limits around all values that are there."""
    values = np.concatenate(lines)
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    margin = 0.05 * (high - low)
    if not margin > 1e-12 * max(abs(low), abs(high)):
        margin = 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def divergence(record: Dataset, simulated: NDArray[np.float64]) -> list[tuple[slice, int]]:
    """Return every segment whose simulation ends before it does, and the last sample simulated there."""
    found = []
    for begin, end in record.bounds:
        there = np.flatnonzero(~np.isnan(simulated[begin:end]))
        if there.size and begin + there[-1] < end - 1:
            found.append((slice(begin, end), begin + int(there[-1])))
    return found


def annotate_divergence(axes: Axes, lines: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
    """Write where each diverging line leaves the axes, once where several do.

    Parameters
    ----------
    axes : Axes
        With its limits set.
    lines : sequence of (x, y)
        Each without NaN, up to its last sample, in the order of ``x``; one without samples is left out.
    """
    low, high = axes.get_ylim()
    left, right = axes.get_xlim()
    said: list[tuple[float, float]] = []
    for x, y in (line for line in lines if len(line[0])):
        inside = np.flatnonzero((y >= low) & (y <= high))
        at = min(int(inside[-1]) + 1, len(y) - 1) if inside.size else 0
        end = float(x[at]), float(np.clip(y[at], low, high))
        axes.plot(*end, "x", color=SIMULATED, markersize=5, clip_on=False, zorder=4)
        if any(abs(end[0] - other[0]) < _APART * (right - left) for other in said):
            continue
        said.append(end)
        _write(axes, end, end[0] > left + 0.8 * (right - left), end[1] > (low + high) / 2)


def _write(axes: Axes, end: tuple[float, float], to_the_left: bool, below: bool) -> None:
    words = axes.annotate(
        "diverged",
        end,
        xytext=(-6 if to_the_left else 6, -7 if below else 7),
        textcoords="offset points",
        ha="right" if to_the_left else "left",
        va="center",
        fontsize=REMARK,
        color=SIMULATED,
        zorder=5,
    )
    # A thin white rim, not a box: what lies under the word stays visible around it.
    words.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
