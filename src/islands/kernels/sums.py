"""Long sums in a written order.

A loop that adds into one number can only be vectorised by adding in another order, and that order would
depend on the processor. Here it stands in the source: products are made 256 at a time, folded in halves
(element i takes element i + 128, then i + 64, ...), and the chunks' sums are added from first to last. Every
kernel that sums over the rows of a record uses this order, so a number does not depend on which of them
computed it.
"""

import numpy as np
from numba import njit

#: Rows that are folded together; a short last chunk is filled with zeros.
FOLD = 256


@njit(nogil=True, cache=True, error_model="numpy")
def dot_chunk(x, x_at, y, y_at, rows, fold):
    """Return the inner product of at most 256 rows of two flat arrays; ``fold`` is room for 256 numbers."""
    for index in range(rows):
        fold[index] = x[x_at + index] * y[y_at + index]
    for index in range(rows, np.uint64(FOLD)):
        fold[index] = 0.0
    half = np.uint64(FOLD // 2)
    while half > 0:
        for index in range(half):
            fold[index] += fold[index + half]
        half //= np.uint64(2)
    return fold[0]


@njit(nogil=True, cache=True, error_model="numpy")
def dot(x, x_at, y, y_at, rows, fold):
    """Return the inner product of ``rows`` rows of two flat arrays, from offsets ``x_at`` and ``y_at`` on."""
    total = 0.0
    done = np.uint64(0)
    rows = np.uint64(rows)
    while done < rows:
        chunk = min(np.uint64(FOLD), rows - done)
        total += dot_chunk(x, np.uint64(x_at) + done, y, np.uint64(y_at) + done, chunk, fold)
        done += chunk
    return total


@njit(nogil=True, cache=True, error_model="numpy")
def total(x):
    """Return the sum of a flat array."""
    return dot(x, 0, np.ones_like(x), 0, x.size, np.empty(FOLD))
