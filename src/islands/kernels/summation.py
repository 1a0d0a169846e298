"""Fixed-order summation of long vectors.

A loop that adds to one number can be vectorised only by changing the order of the additions, and that order
would depend on the processor. Here the source defines the order:

1. Rows are processed in chunks of 256. Lane j of eight adds the rows j, j + 8, ... from first to last.
2. The eight lanes are added to eight running sums, from the first chunk to the last.
3. The eight running sums are folded to one number: the second half is added to the first half, repeatedly.

Every kernel whose inner products are compared or stored uses this order, so an inner product does not depend
on the kernel that computed it.
"""

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, broadcast, fold, load, multiply

#: Rows of a chunk; a short last chunk is filled with zeros.
CHUNK = 256


@kernel(forceinline=True)
def dot_chunk(x, x_at, y, y_at):
    """Return the eight lanes of the inner product of 256 rows of two flat arrays."""
    lanes = broadcast(0.0, 1)
    for row in range(0, CHUNK, VECTOR):
        lanes = add(lanes, multiply(load(x, x_at + row, 1), load(y, y_at + row, 1)))
    return lanes


@kernel
def dot(x, x_at, y, y_at, rows):
    """Return the inner product of ``rows`` rows of two flat arrays from offsets ``x_at`` and ``y_at`` on."""
    running = broadcast(0.0, 1)
    done = 0
    while done + CHUNK <= rows:
        running = add(running, dot_chunk(x, x_at + done, y, y_at + done))
        done += CHUNK
    if done < rows:
        last = np.zeros(2 * CHUNK)
        for index in range(rows - done):
            last[index] = x[x_at + done + index]
            last[CHUNK + index] = y[y_at + done + index]
        running = add(running, dot_chunk(last, 0, last, CHUNK))
    return fold(running)


@kernel
def total(x):
    """Return the sum of a flat array."""
    return dot(x, 0, np.ones_like(x), 0, x.size)
