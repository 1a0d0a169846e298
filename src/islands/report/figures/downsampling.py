"""Downsampling of lines that keeps their peaks (M4)."""

import numpy as np
from numpy.typing import NDArray

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
