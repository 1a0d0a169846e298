"""Resampling onto a uniform grid: linear interpolation, and a low-pass filter before a coarser grid."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

#: Taps of the low-pass filter on each side, in samples of the new grid.
_HALF_TAPS = 10

#: Descriptions of both ways, for the result.
LINEAR = "linear interpolation"
FILTERED = "a linear-phase low-pass filter (Hamming window) and linear interpolation"


def resample(
    stamps: NDArray[np.float64], values: NDArray[np.float64], dt: float, usual: float
) -> tuple[NDArray[np.float64], str]:
    """Resample the columns of one recording.

    A coarser grid would fold frequencies above half of its rate into the result. They are removed on a
    finer uniform grid by a finite impulse response filter, which does not delay the signals.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        Increasing times.
    values : ndarray, shape (samples, columns)
        Finite values, or NaN where the result is NaN too.
    dt, usual : float
        Step of the new grid, and the usual step of the stamps, in the same unit.

    Returns
    -------
    values : ndarray, shape (new samples, columns)
        The first new sample is at the first stamp.
    method : str
        `LINEAR` or `FILTERED`.
    """
    count = int((stamps[-1] - stamps[0]) / dt * (1.0 + 1e-12)) + 1
    ratio = ceil(dt / usual - 1e-6)
    if ratio <= 1:
        grid = stamps[0] + dt * np.arange(count)
        return _interpolate(grid, stamps, values), LINEAR
    # The values at the ends continue beyond the recording.
    reach = _HALF_TAPS * ratio
    fine = stamps[0] + dt / ratio * np.arange(-reach, (count - 1) * ratio + reach + 1)
    padded = _interpolate(fine, stamps, values)
    taps = _low_pass_taps(ratio)
    filtered = np.zeros((count, values.shape[1]))
    # Summed tap by tap: the order of the sum is the same on every machine.
    for place, tap in enumerate(taps.tolist()):
        filtered += tap * padded[place : place + (count - 1) * ratio + 1 : ratio]
    return filtered, FILTERED


def _interpolate(
    grid: NDArray[np.float64], stamps: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.column_stack([np.interp(grid, stamps, column) for column in values.T])


def _low_pass_taps(ratio: int) -> NDArray[np.float64]:
    """Return a windowed sinc with a cut-off at 0.8 of half the new rate; the taps sum to one."""
    offsets = np.arange(-_HALF_TAPS * ratio, _HALF_TAPS * ratio + 1, dtype=np.float64)
    taps = np.sinc(0.8 * offsets / ratio) * np.hamming(len(offsets))
    normalised: NDArray[np.float64] = taps / taps.sum()
    return normalised
