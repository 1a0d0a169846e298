"""Lines of figures: gaps and divergence, parts of long records, and downsampling that keeps peaks (M4)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.records.loops import loop_starts
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


#: Loops that are distinguishable in one panel.
LOOPS = 5

#: A record with more loops than this is shown completely and in a section.
MANY_LOOPS = 20

#: Smallest number of samples of a section; shorter sections are readable in the complete record.
_MIN_SAMPLES = 60


def last_loops(record: Dataset) -> slice:
    """Return the last `LOOPS` complete loops of a record, or the record if it does not have more."""
    starts = loop_starts(record)
    if len(starts) <= LOOPS + 1:
        return slice(0, record.samples)
    return slice(int(starts[-LOOPS - 1]), int(starts[-1]) + 1)


def representative_window(record: Dataset, residual: NDArray[np.float64]) -> slice | None:
    """Return a section of about `LOOPS` loops whose mean absolute residual is the median of all sections.

    Sections with missing residuals are ignored; if all have missing residuals, the first section is returned.

    Parameters
    ----------
    residual : ndarray, shape (samples,)

    Returns
    -------
    slice or None
        None if the record is short enough to be shown completely.
    """
    loops = len(loop_starts(record))
    if loops <= MANY_LOOPS:
        return None
    length = max(_MIN_SAMPLES, record.samples * LOOPS // loops)
    if record.samples < 4 * length:
        return None
    sections = [
        slice(first, first + length)
        for begin, end in record.bounds
        for first in range(begin, end - length + 1, length)
    ] or [slice(first, first + length) for first in range(0, record.samples - length + 1, length)]
    errors = np.array([np.abs(residual[section]).mean() for section in sections])
    ranked = np.argsort(errors, kind="stable")[: np.count_nonzero(~np.isnan(errors))]
    return sections[ranked[len(ranked) // 2] if ranked.size else 0]


#: Vertices of a downsampled line, about four for each 0.3 mm of a column 7 inches wide.
VERTICES = 2000

Line = tuple[NDArray[np.float64], NDArray[np.float64]]


def envelope(
    x: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    vertices: int = VERTICES,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the envelope of a band: its lowest and highest value in each block of samples.

    Parameters
    ----------
    x, lower, upper : ndarray, shape (samples,)
        Abscissas and limits; NaN is a gap.
    vertices : int
        A band with at most half this number of samples is returned unchanged, of a longer one at most this
        number of samples.

    Returns
    -------
    x, lower, upper : ndarray, shape (kept,)
        First and last abscissa of each block, with the limits of the block; NaN if it has no value.
    """
    size = -(-2 * len(x) // vertices)
    if size <= 1:
        return x, lower, upper
    first = np.arange(0, len(x), size)
    low, high = np.fmin.reduceat(lower, first), np.fmax.reduceat(upper, first)
    at = np.column_stack([np.fmin.reduceat(x, first), np.fmax.reduceat(x, first)]).ravel()
    return at, np.repeat(low, 2), np.repeat(high, 2)


def downsample(x: NDArray[np.float64], y: NDArray[np.float64], vertices: int = VERTICES) -> Line:
    """Keep of each block the samples at which ``x`` or ``y`` is extreme or a gap begins or ends.

    For a time axis these are the first, last, smallest and largest sample of each pixel column (M4: Jugel,
    Jerzak, Hackenbroich & Markl, Proc. VLDB Endowment 7 (2014) 797-808). For loops the tips are kept, too.

    Parameters
    ----------
    x, y : ndarray, shape (samples,)
        Coordinates of the line; NaN is a gap.
    vertices : int
        A line with at most this number of samples is returned unchanged. Of a longer line at most this number
        is kept, plus two for each block with a gap.

    Returns
    -------
    x, y : ndarray, shape (kept,)
        Samples that are kept, in their order.
    """
    if len(x) <= vertices:
        return x, y
    size = -(-4 * len(x) // vertices)
    blocks = -(-len(x) // size)
    padding = (0, blocks * size - len(x))
    gap = np.isnan(x) | np.isnan(y)
    first = size * np.arange(blocks)
    kept = []
    for values in (x, -x, y, -y):
        low = np.pad(np.where(gap, np.inf, values), padding, constant_values=np.inf)
        kept.append(first + low.reshape(blocks, size).argmin(axis=1))
    gaps = np.pad(gap, padding).reshape(blocks, size)
    has_gap = gaps.any(axis=1)
    kept.append((first + gaps.argmax(axis=1))[has_gap])
    kept.append((first + size - 1 - gaps[:, ::-1].argmax(axis=1))[has_gap])
    order = np.unique(np.concatenate(kept))
    return x[order], y[order]
