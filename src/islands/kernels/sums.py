"""Long sums in a written order.

A loop that adds into one number can only be vectorised by adding in another order, and that order would
depend on the processor. Here it stands in the source. Rows are taken 256 at a time: of these, lane j of 32
adds rows j, j + 32, ... from first to last, and the 32 lanes are folded to eight. Those eight are added to
eight running sums, from the first 256 rows to the last, and at the end the eight are folded to one number. A
fold adds the second half to the first. Every kernel that sums over the rows of a record uses this order, so a
number does not depend on which of them computed it.
"""

import numpy as np

from islands.kernels.compilation import kernel
from islands.kernels.lanes import VECTOR, add, fold, half, load, multiply, splat

#: Rows that are taken together; a short last chunk is filled with zeros.
CHUNK = 256

#: Vectors that add the rows of a chunk.
COUNT = 4


@kernel(forceinline=True)
def dot_chunk(x, x_at, y, y_at):
    """Return the eight lanes of the inner product of 256 rows of two flat arrays."""
    lanes = splat(0.0, COUNT)
    for group in range(0, CHUNK, VECTOR * COUNT):
        step = np.uint64(group)
        lanes = add(lanes, multiply(load(x, x_at + step, COUNT), load(y, y_at + step, COUNT)))
    return half(half(lanes))


@kernel
def dot(x, x_at, y, y_at, rows):
    """Return the inner product of ``rows`` rows of two flat arrays, from offsets ``x_at`` and ``y_at`` on."""
    running = splat(0.0, 1)
    done = 0
    while done + CHUNK <= rows:
        running = add(running, dot_chunk(x, np.uint64(x_at + done), y, np.uint64(y_at + done)))
        done += CHUNK
    if done < rows:
        last = np.zeros(2 * CHUNK)
        for index in range(rows - done):
            last[index] = x[x_at + done + index]
            last[CHUNK + index] = y[y_at + done + index]
        running = add(running, dot_chunk(last, np.uint64(0), last, np.uint64(CHUNK)))
    return fold(running)


@kernel
def total(x):
    """Return the sum of a flat array."""
    return dot(x, 0, np.ones_like(x), 0, x.size)
