"""QR factorisation of a tall matrix, with the sums in the order of `islands.kernels.summation`.

Modified Gram-Schmidt, every column orthogonalised twice ("twice is enough": Giraud, Langou and Rozloznik
2005). It is as accurate as Householder reflections, and its sums do not depend on the number of threads of a
linear algebra library.

Zeros before and after the other values of a column are left out of its sums, which does not change their
bits. A column that belongs to one segment of a record therefore costs the rows of that segment.
"""

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.kernels.summation import CHUNK, dot


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
    begins, ends = np.empty(columns, np.int64), np.empty(columns, np.int64)
    for j in range(columns):
        at = j * rows
        begins[j], ends[j] = _find_support(matrix[j])
        norm = np.sqrt(dot(flat, at + begins[j], flat, at + begins[j], ends[j] - begins[j]))
        for _ in range(2):
            for i in range(j):
                begin, end = max(begins[i], begins[j]), min(ends[i], ends[j])
                weight = dot(flat, i * rows + begin, flat, at + begin, end - begin) if begin < end else 0.0
                if weight == 0.0:
                    continue
                triangle[i, j] += weight
                begin, count = begins[i], ends[i] - begins[i]
                _subtract(flat, at + begin, weight, flat, i * rows + begin, count)
                begins[j], ends[j] = min(begin, begins[j]), max(ends[i], ends[j])
        begin, count = at + begins[j], ends[j] - begins[j]
        kept = np.sqrt(dot(flat, begin, flat, begin, count))
        if not kept > tolerance * norm:
            return j
        triangle[j, j] = kept
        for index in range(np.uint64(count)):
            flat[np.uint64(begin) + index] /= kept
    for _ in range(2):
        for j in range(columns):
            begin, count = begins[j], ends[j] - begins[j]
            weight = dot(flat, j * rows + begin, target, begin, count)
            projection[j] += weight
            _subtract(target, begin, weight, flat, j * rows + begin, count)
    return -1


@kernel
def _find_support(column):
    """Return the chunks of rows outside of which a column is zero: the first row, and that after the last."""
    begin, end = 0, column.size
    while begin < end and column[begin] == 0.0:
        begin += 1
    while end > begin and column[end - 1] == 0.0:
        end -= 1
    return begin // CHUNK * CHUNK, min(column.size, -(-end // CHUNK) * CHUNK)


@kernel
def _subtract(x, x_at, weight, y, y_at, rows):
    """Subtract in place: ``x -= weight * y``."""
    for index in range(np.uint64(rows)):
        x[np.uint64(x_at) + index] -= weight * y[np.uint64(y_at) + index]
