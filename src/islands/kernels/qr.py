"""QR factorisation of a tall matrix, with the sums in the order of `islands.kernels.summation`.

Modified Gram-Schmidt, every column orthogonalised twice ("twice is enough": Giraud, Langou and Rozloznik
2005). It is as accurate as Householder reflections, and its sums do not depend on the number of threads of a
linear algebra library.
"""

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.kernels.summation import dot


@kernel
def orthogonalise(
    matrix,  # in and out, float64 [column, row]: becomes Q, with columns of norm 1
    target,  # in and out, float64 [row]: becomes the residual, orthogonal to Q
    triangle,  # out, float64 [column, column]: R, upper
    projection,  # out, float64 [column]: Q'y
    tolerance,  # a column that keeps at most this fraction of its norm depends on the columns before it
):
    """Factor ``matrix = Q R`` and return the index of the first dependent column, or -1.

    A dependent column ends the factorisation; the outputs are then undefined.
    """
    columns, rows = matrix.shape
    flat = matrix.reshape(-1)
    triangle[:] = 0.0
    projection[:] = 0.0
    for j in range(columns):
        at = j * rows
        norm = np.sqrt(dot(flat, at, flat, at, rows))
        for _ in range(2):
            for i in range(j):
                weight = dot(flat, i * rows, flat, at, rows)
                triangle[i, j] += weight
                _subtract(flat, at, weight, flat, i * rows, rows)
        kept = np.sqrt(dot(flat, at, flat, at, rows))
        if not kept > tolerance * norm:
            return j
        triangle[j, j] = kept
        for index in range(np.uint64(rows)):
            flat[np.uint64(at) + index] /= kept
    for _ in range(2):
        for j in range(columns):
            weight = dot(flat, j * rows, target, 0, rows)
            projection[j] += weight
            _subtract(target, 0, weight, flat, j * rows, rows)
    return -1


@kernel
def _subtract(x, x_at, weight, y, y_at, rows):
    """Subtract in place: ``x -= weight * y``."""
    for index in range(np.uint64(rows)):
        x[np.uint64(x_at) + index] -= weight * y[np.uint64(y_at) + index]
