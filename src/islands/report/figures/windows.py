"""Parts of long records that figures show: the last loops, or a representative section."""

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.loops import loop_starts

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
