"""Lines of simulations that may diverge: finite part, axis limits and annotations."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.report.figures.style import REMARK, SIMULATED
from islands.simulation.predictors import find_divergence_bound

#: Smallest distance between two annotations, as a fraction of the axis width.
_MIN_DISTANCE = 0.12


def finite_part(record: Dataset, simulated: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a simulation in which infinite values and values beyond the divergence bound are NaN.

    Raises
    ------
    SettingsError
        The simulation does not have one value per sample.
    """
    values = np.array(simulated, dtype=np.float64)
    if values.shape != (record.samples,):
        raise SettingsError(
            f"a simulation has one value for each of the record's {record.samples} samples, "
            f"got shape {values.shape}"
        )
    values[~(np.abs(values) <= find_divergence_bound(record))] = np.nan
    return values


def break_line(record: Dataset, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values with a NaN between segments, so that no line connects segments."""
    return np.insert(values, [end for _, end in record.bounds[:-1]], np.nan)


def within_reach(record: Dataset, simulated: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values clipped to one output range beyond the measured output, for axis limits."""
    known = record.y[~np.isnan(record.y)]
    if not known.size:
        return simulated
    span = float(np.ptp(known)) or float(abs(known[0])) or 1.0
    return np.clip(simulated, known.min() - span, known.max() + span)


def limits(*lines: NDArray[np.float64]) -> tuple[float, float]:
    """Return axis limits around all values that are not NaN."""
    values = np.concatenate(lines)
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    margin = 0.05 * (high - low)
    if not margin > 1e-12 * max(abs(low), abs(high)):
        margin = 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def divergence(record: Dataset, simulated: NDArray[np.float64]) -> list[tuple[slice, int]]:
    """Return every segment whose simulation ends early, with its last simulated sample."""
    diverged = []
    for begin, end in record.bounds:
        known = np.flatnonzero(~np.isnan(simulated[begin:end]))
        if known.size and begin + known[-1] < end - 1:
            diverged.append((slice(begin, end), begin + int(known[-1])))
    return diverged


def annotate_divergence(axes: Axes, lines: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
    """Mark where each diverging line leaves the axes; annotate neighbouring marks once.

    Parameters
    ----------
    axes : Axes
        Axes whose limits are set.
    lines : sequence of (x, y)
        Lines without NaN up to their last sample, ordered by ``x``; empty lines are ignored.
    """
    low, high = axes.get_ylim()
    left, right = axes.get_xlim()
    annotated: list[tuple[float, float]] = []
    for x, y in (line for line in lines if len(line[0])):
        inside = np.flatnonzero((y >= low) & (y <= high))
        at = min(int(inside[-1]) + 1, len(y) - 1) if inside.size else 0
        end = float(x[at]), float(np.clip(y[at], low, high))
        axes.plot(*end, "x", color=SIMULATED, markersize=5, clip_on=False, zorder=4)
        if any(abs(end[0] - other[0]) < _MIN_DISTANCE * (right - left) for other in annotated):
            continue
        annotated.append(end)
        _annotate(axes, end, end[0] > left + 0.8 * (right - left), end[1] > (low + high) / 2)


def _annotate(axes: Axes, end: tuple[float, float], to_the_left: bool, below: bool) -> None:
    text = axes.annotate(
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
    # Use a thin white outline instead of a box, so that lines below the text stay visible.
    text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
