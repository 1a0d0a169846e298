"""Level of the white noise of a signal, from differences of high order.

Differences of high order of a signal that is sampled densely enough vanish; those of its noise do not. If
differences of several orders give the same level, it is that of noise. Otherwise the signal itself changes
within a few samples, and the smallest level is an upper bound.
"""

from math import comb

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset

#: Order of the differences that separate the noise from the signal.
_ORDER = 4

#: Median of the absolute value of a normal variable, in standard deviations.
_MEDIAN = 0.6745


def estimate_noise(signal: NDArray[np.float64], record: Dataset, order: int = _ORDER) -> float:
    """Return the standard deviation of the white noise of a signal.

    The median ignores the steps of an input.

    Parameters
    ----------
    signal : ndarray, shape (samples,)
        A signal of the record. Differences with a missing value are left out.
    record : Dataset
        Record whose segments no difference crosses.
    order : int
        Order of the differences.
    """
    differences = np.concatenate([np.diff(signal[first:last], order) for first, last in record.bounds])
    size = np.abs(differences[np.isfinite(differences)])
    return float(np.median(size) / (_MEDIAN * comb(2 * order, order) ** 0.5)) if size.size else 0.0
