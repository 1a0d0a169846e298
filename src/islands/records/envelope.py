"""Envelope of a signal: extremes of equal parts, for a plot with fewer points than the signal has samples."""

import numpy as np
from numpy.typing import NDArray


def find_envelope(
    values: NDArray[np.float64], points: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the least and the greatest value of every part of a signal, and the first samples of the parts.

    Decimation by the extremes keeps every peak, whatever the number of points.

    Parameters
    ----------
    values : ndarray, shape (samples,)
        Missing values are NaN.
    points : int
        Number of parts, at least 1. A shorter signal has one part for each sample.

    Returns
    -------
    least, greatest : ndarray, shape (parts,)
        NaN where all values of a part are missing.
    first : ndarray of int64, shape (parts,)
    """
    parts = min(points, values.size)
    first = np.arange(parts, dtype=np.int64) * values.size // max(parts, 1)
    if not parts:
        return values, values, first
    return np.fmin.reduceat(values, first), np.fmax.reduceat(values, first), first
