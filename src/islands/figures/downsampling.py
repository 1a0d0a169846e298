"""Draws no more vertices than a column of print can show, and loses no peak."""

import numpy as np
from numpy.typing import NDArray

#: Vertices of a thinned line, about four for each 0.3 mm of a column 7 inches wide.
VERTICES = 2000

Line = tuple[NDArray[np.float64], NDArray[np.float64]]


def thin(x: NDArray[np.float64], y: NDArray[np.float64], vertices: int = VERTICES) -> Line:
    """Keep of every block of samples those where ``x`` or ``y`` is extreme, and where a gap begins and ends.

    Over a time axis that is first, last, least and largest of each pixel column (M4: Jugel, Jerzak,
    Hackenbroich & Markl, Proc. VLDB Endowment 7 (2014) 797-808); of a loop it keeps the tips as well.

    Parameters
    ----------
    x, y : ndarray, shape (samples,)
        A line; NaN is a gap.
    vertices : int
        A line of no more samples is returned as it is; of a longer one at most this many are kept, and two
        more for each block that has a gap.

    Returns
    -------
    x, y : ndarray, shape (kept,)
        Samples of the line in their order.
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
    torn = gaps.any(axis=1)
    kept.append((first + gaps.argmax(axis=1))[torn])
    kept.append((first + size - 1 - gaps[:, ::-1].argmax(axis=1))[torn])
    order = np.unique(np.concatenate(kept))
    return x[order], y[order]
