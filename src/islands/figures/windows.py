"""Which part of a long record a figure shows: its last loops, or a stretch that stands for the whole."""

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset

#: Loops that can be told apart in one panel.
LOOPS = 5

#: A record of more loops than this is shown as a whole and in part.
MANY_LOOPS = 20

#: A stretch has at least this many samples: fewer can be read beside many others as well.
_SHORTEST = 60


def loop_starts(record: Dataset) -> NDArray[np.int64]:
    """Return the samples where the first input that varies rises through its mean: a loop each.

    A rise counts when it leads from a quarter of the standard deviation below the mean to as much above it,
    so that noise on a slow input makes no loops.
    """
    u = record.u[:, int(np.argmax(np.ptp(record.u, axis=0) > 0))]
    u = u - u.mean()
    away = np.flatnonzero(np.abs(u) > 0.25 * u.std())
    rises = np.flatnonzero(np.diff(np.sign(u[away])) > 0)
    return away[rises + 1]


def last_loops(record: Dataset) -> slice:
    """Return the last `LOOPS` whole loops of a record, or all of it where there are no more."""
    starts = loop_starts(record)
    if len(starts) <= LOOPS + 1:
        return slice(0, record.samples)
    return slice(int(starts[-LOOPS - 1]), int(starts[-1]) + 1)


def representative_window(record: Dataset, residual: NDArray[np.float64]) -> slice | None:
    """Return `LOOPS` loops whose mean absolute residual is the median of all such stretches.

    None where the record can be read as a whole. Stretches in which a residual is missing do not count;
    where no other is left it is the first, in which the simulation begins.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
    """
    loops = len(loop_starts(record))
    if loops <= MANY_LOOPS:
        return None
    length = max(_SHORTEST, record.samples * LOOPS // loops)
    if record.samples < 4 * length:
        return None
    stretches = [
        slice(first, first + length)
        for begin, end in record.bounds
        for first in range(begin, end - length + 1, length)
    ] or [slice(first, first + length) for first in range(0, record.samples - length + 1, length)]
    errors = np.array([np.abs(residual[stretch]).mean() for stretch in stretches])
    ranked = np.argsort(errors, kind="stable")[: np.count_nonzero(~np.isnan(errors))]
    return stretches[ranked[len(ranked) // 2] if ranked.size else 0]
