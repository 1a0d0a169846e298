"""Clocks of the columns of a record: a column may be sampled less often than the rows of its file.

Loggers write the samples of a slow channel in three ways: with empty cells between them, with the last value
held until the next sample, or in rows between those of other channels (an outer join of two recordings).
Random missing cells have no period, and the missing cells of a failed sensor are consecutive: neither is a
clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

#: Own samples, and changes of a held value, that determine a clock, at least.
_LEAST_SAMPLES, _LEAST_CHANGES = 12, 20

#: Part of the rows in which a held value changes, at most: more are samples with equal values at times.
_MOST_CHANGES = 0.9

#: Part of the steps of a clock that are regular, at least, and their tolerance relative to the usual step.
_REGULAR, _TOLERANCE = 0.85, 0.25

#: Distinct values of a held signal, at least, and part of its jumps of equal size, at most: a command has a
#: few levels, and the steps of a coarse sensor have one size.
_LEAST_LEVELS, _MOST_EQUAL = 10, 0.6

#: Rows of a period from which on its samples may be late by a row.
_LEAST_LATE = 5

#: Difference of two steps, relative to the longer one, up to which they are equal.
SAME_STEP = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class ColumnClock:
    """Samples of a column.

    Attributes
    ----------
    rows : ndarray of int, shape (samples,)
        Rows of the file that hold the samples.
    stamps : ndarray, shape (samples,)
        Times of the samples.
    step : float
        Usual step of the stamps.
    kind : str
        ``rows`` if the column has the clock of the rows, ``cells`` if only some of its cells have values,
        ``held`` if its values are held between the samples.
    """

    rows: NDArray[np.int64]
    stamps: NDArray[np.float64]
    step: float
    kind: str


def may_differ(values: NDArray[np.float64], outputs: Sequence[int]) -> bool:
    """Return whether columns may have different clocks: one has many empty cells, or an output rests often.

    Columns with infinite values are refused before their clocks are of interest.
    """
    if len(values) < 2 * _LEAST_SAMPLES or np.isinf(values).any():
        return False
    empty = np.isnan(values).mean(axis=0)
    rests = [float(np.mean(values[1:, place] == values[:-1, place])) for place in outputs]
    return bool((empty > 1 - _MOST_CHANGES).any() or max(rests, default=0.0) >= 1 - _MOST_CHANGES)


def find_clocks(
    stamps: NDArray[np.float64], values: NDArray[np.float64], outputs: Sequence[int]
) -> tuple[ColumnClock, ...]:
    """Return the clocks of all columns; empty if all have the clock of the rows.

    Held values are those of a sensor if an output has them. An input is held if it changes in the rows of
    such an output, and is a command otherwise.

    Parameters
    ----------
    stamps : ndarray, shape (rows,)
        Times of the rows, in which a column need not have a sample.
    values : ndarray, shape (rows, columns)
        NaN marks an empty cell.
    outputs : sequence of int
        Columns that are outputs.
    """
    timed = np.isfinite(stamps)
    steps = np.diff(stamps[timed])
    if len(steps) < 2 * _LEAST_SAMPLES or not (steps > 0).any():
        return ()
    present = [np.flatnonzero(timed & np.isfinite(column)) for column in values.T]
    is_stacked = bool((steps < 0).any())
    by_cells = [_find_cells(rows, stamps[rows], len(stamps), is_stacked) for rows in present]
    if any(each.kind == "cells" for each in by_cells):
        by_cells = [_without_gaps(each) for each in by_cells]
    held = [_find_held(stamps, column, rows) for column, rows in zip(values.T, present, strict=True)]
    chosen = _choose_held(held, outputs, _is_regular(steps))
    clocks = tuple(
        hold if hold is not None and place in chosen else own
        for place, (hold, own) in enumerate(zip(held, by_cells, strict=True))
    )
    return clocks if any(each.kind != "rows" for each in clocks) else ()


def _usual(stamps: NDArray[np.float64]) -> float:
    steps = np.diff(stamps)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def _is_regular(steps: NDArray[np.float64]) -> bool:
    usual = float(np.median(steps))
    return usual > 0 and float(np.mean(np.abs(steps - usual) <= _TOLERANCE * usual)) >= _REGULAR


def _find_cells(
    rows: NDArray[np.int64], stamps: NDArray[np.float64], count: int, is_stacked: bool
) -> ColumnClock:
    """Return the clock of the cells that have a value: that of the column, if it is regular, or of the rows.

    The samples of a column with a clock are rows apart, or one block of rows if recordings are stacked.
    """
    step, steps = _usual(stamps), np.diff(stamps)
    if len(rows) >= _LEAST_SAMPLES:
        is_apart = bool(np.median(np.diff(rows)) >= 2)
        is_block = is_stacked and len(rows) < count and bool((steps > 0).all())
        if (is_apart or is_block) and _is_regular(steps):
            return ColumnClock(rows, stamps, step, "cells")
        if not _is_regular(steps):
            # An irregular clock has longer steps than the usual one, which are no gaps.
            step = max(step, float(np.quantile(steps, 0.99)))
    return ColumnClock(rows, stamps, step, "rows")


def _without_gaps(own: ColumnClock) -> ColumnClock:
    """Return a clock of cells if the empty cells of a column leave no gap: they are rows of other clocks."""
    steps = np.diff(own.stamps)
    if own.kind == "cells" or len(own.rows) == np.ptp(own.rows) + 1 or not _is_regular(steps):
        return own
    is_whole = bool((np.abs(steps - own.step) <= _TOLERANCE * own.step).all())
    return ColumnClock(own.rows, own.stamps, own.step, "cells") if is_whole else own


def _choose_held(
    held: Sequence[ColumnClock | None], outputs: Sequence[int], is_uniform: bool
) -> frozenset[int]:
    """Return the columns whose held values are those of a sensor and not of a command.

    An input that changes in the same rows as an output has its clock: both are samples of one logger, or the
    output follows the input at once, and the rows between repeat both. In an outer join, an input may change
    in the rows of the output by chance.
    """
    found = {place: own for place in outputs if (own := held[place]) is not None}
    if not outputs and held and all(held) and _are_equal([own for own in held if own is not None]):
        return frozenset(range(len(held)))
    if is_uniform:
        for place, each in enumerate(held):
            if each is not None and any(_are_equal([own, each]) for own in found.values()):
                found.setdefault(place, each)
    return frozenset(found)


def _are_equal(clocks: Sequence[ColumnClock]) -> bool:
    """Return whether held values change in the same rows, apart from those that hold the first sample."""
    first, *others = clocks
    return all(
        abs(each.step - first.step) <= SAME_STEP * first.step
        and np.isin(each.rows[1:-1], first.rows).mean() > 1 - SAME_STEP
        for each in others
    )


def _find_held(
    stamps: NDArray[np.float64], column: NDArray[np.float64], rows: NDArray[np.int64]
) -> ColumnClock | None:
    """Return the clock of values that are held between samples; None if the column has none."""
    known = column[rows]
    changes = np.flatnonzero(known[1:] != known[:-1]) + 1
    if (
        not _LEAST_CHANGES <= len(changes) <= _MOST_CHANGES * len(known)
        or len(np.unique(known)) < _LEAST_LEVELS
    ):
        return None
    with np.errstate(over="ignore"):
        jumps = np.abs(known[changes] - known[changes - 1])
    scale = float(jumps.max())
    if not np.isfinite(scale):
        return None
    if np.unique(np.round(jumps / scale, 9), return_counts=True)[1].max() > _MOST_EQUAL * len(jumps):
        return None
    times = stamps[rows]
    if not _is_regular(np.diff(times)):
        return _find_period_of_times(times, changes, rows)
    period = gcd(*np.diff(changes).tolist())
    if period > 1:
        places = np.arange(changes[0] % period, len(known), period)
        return ColumnClock(rows[places], times[places], _usual(times[places]), "held")
    return _find_late_period(times, changes, rows)


def _find_period_of_times(
    times: NDArray[np.float64], changes: NDArray[np.int64], rows: NDArray[np.int64]
) -> ColumnClock | None:
    """Return the clock of changes that are regular in time while the rows are not."""
    moments = times[changes]
    usual = _usual(moments)
    if usual <= 0.0:
        return None
    steps = np.diff(moments)
    counts = np.rint(steps / usual)
    if (counts < 1).any() or (np.abs(steps - usual * counts) > SAME_STEP * usual * counts).any():
        return None
    return ColumnClock(rows[changes], moments, usual, "held")


def _find_late_period(
    times: NDArray[np.float64], changes: NDArray[np.int64], rows: NDArray[np.int64]
) -> ColumnClock | None:
    """Return the clock of samples with a period of a broken number of rows: each is in the next row."""
    gaps = np.diff(changes)
    usual = float(np.median(gaps))
    if usual < _LEAST_LATE:
        return None
    counts = np.cumsum(np.concatenate(([0.0], np.rint(gaps / usual))))
    period, first = np.polyfit(counts, changes, 1)
    # The period is known well after the first fit, so that long holds are counted correctly.
    counts = np.rint((changes - first) / period)
    period, first = np.polyfit(counts, changes, 1)
    if period < _LEAST_LATE or np.abs(changes - first - period * counts).max() > 1.0:
        return None
    ticks = np.arange(counts[0], np.floor((len(times) - 1 - first) / period) + 1)
    places = np.minimum(np.rint(first + period * ticks).astype(np.int64), len(times) - 1)
    places[np.isin(ticks, counts)] = changes[np.isin(counts, ticks)]
    # A sample is half a row old on average when its row is written.
    moments = np.interp(first + period * ticks - 0.5, np.arange(len(times)), times)
    return ColumnClock(rows[places], moments, _usual(moments), "held")
