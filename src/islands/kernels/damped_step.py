"""Damped step of a least-squares fit whose segments have own parameters, the states at their first rows.

The parameters of a segment are eliminated from the normal equations (Schur complement), all by Cholesky
factors. The rows of the factors are vectors: those of the eliminated parameters are subtracted from the
reduced equations as are the rows of the shared ones before, and the right-hand side is one more column.
"""

import math

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, load, multiply_add, padded_size, spread, store
from islands.kernels.simd_functions import negate


@kernel
def factor(matrix):
    """Replace the lower half of a small matrix by its Cholesky factor; return whether it has one."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            if j < i:
                matrix[i, j] = left / matrix[j, j]
            elif left > 0.0:
                matrix[i, i] = math.sqrt(left)
            else:
                return False
    return True


@kernel
def solve_transposed(lower, right):
    """Replace the right-hand side of the equations of the transposed factor by their solution."""
    for k in range(len(lower) - 1, -1, -1):
        left = right[k]
        for i in range(k + 1, len(lower)):
            left -= lower[i, k] * right[i]
        right[k] = left / lower[k, k]


@kernel
def solve_factored(lower, right):
    """Replace the right-hand side of linear equations by their solution."""
    for k in range(len(lower)):
        left = right[k]
        for i in range(k):
            left -= lower[k, i] * right[i]
        right[k] = left / lower[k, k]
    solve_transposed(lower, right)


@kernel(forceinline=True)
def _subtract_rows(rows, width, row, count, place):
    """Subtract, from the place of a row on, the products of the first rows with their values at the place."""
    for p in range(place - place % (4 * VECTOR), width, 4 * VECTOR):
        total = load(rows, row * width + p, 4)
        for k in range(count):
            of_place = negate(spread(rows, k * width + place, 4))
            total = multiply_add(of_place, load(rows, k * width + p, 4), total)
        store(rows, row * width + p, total)


@kernel(forceinline=True)
def _eliminate(own_rows, scale, own_scale, damping, width, blocks, rows):
    """Write the factors of the equations of all segments, and their rows; return whether they exist."""
    shared, own = scale.size, own_scale.shape[1]
    for segment in range(len(own_rows)):
        block = blocks[segment]
        for i in range(own):
            for j in range(own):
                block[i, j] = own_rows[segment, i, shared + j]
            block[i, i] += damping * own_scale[segment, i] ** 2
        if not factor(block):
            return False
        for i in range(own):
            at = (segment * own + i) * width
            for j in range(shared):
                rows[at + j] = own_rows[segment, i, j] / scale[j]
            rows[at + shared] = own_rows[segment, i, shared + own]
            for k in range(i):
                before, ratio = (segment * own + k) * width, block[i, k]
                for j in range(shared + 1):
                    rows[at + j] -= ratio * rows[before + j]
            for j in range(shared + 1):
                rows[at + j] /= block[i, i]
    return True


@kernel
def solve_damped(
    own_rows,  # float64 [segment, own, shared + own + 1]: products of own columns with all, and the error
    total,  # float64 [shared, shared + 1]: of the shared columns of all segments, and with the error
    scale,  # float64 [shared]: scale of each shared parameter
    own_scale,  # float64 [segment, own]
    damping,
    blocks,  # out, float64 [segment, own, own]: Cholesky factors of the equations of the own parameters
    factors,  # out, float64 [segment and own, shared + 1]: rows of the own parameters, then the shared ones
    step,  # out, float64 [shared]: in units of the scale
):
    """Compute the step of the shared parameters; return whether the equations are positive definite."""
    shared, before = scale.size, own_scale.size
    width = -(-(shared + 1) // (4 * VECTOR)) * 4 * VECTOR
    rows = padded_size((before + shared) * width)
    rows[:] = 0.0
    if not _eliminate(own_rows, scale, own_scale, damping, width, blocks, rows):
        return False
    for i in range(shared):
        at = (before + i) * width
        for j in range(i, shared):
            rows[at + j] = total[i, j] / (scale[i] * scale[j])
        rows[at + i] += damping
        rows[at + shared] = total[i, shared] / scale[i]
        _subtract_rows(rows, width, before + i, before + i, i)
        pivot = rows[at + i]
        if not pivot > 0.0:
            return False
        pivot = math.sqrt(pivot)
        for j in range(i, shared + 1):
            rows[at + j] /= pivot
    for k in range(shared - 1, -1, -1):
        at = (before + k) * width
        left = rows[at + shared]
        for j in range(k + 1, shared):
            left -= rows[at + j] * step[j]
        step[k] = left / rows[at + k]
    factors[:] = rows.reshape((before + shared, width))[:, : shared + 1]
    return True


@kernel
def solve_own(
    blocks,  # float64 [segment, own, own]: of `solve_damped`, as the factors
    factors,
    step,  # float64 [shared]: in units of the scale
    changes,  # out, float64 [segment, own]
):
    """Compute the step of the own parameters after one of the shared ones."""
    shared, own = step.size, changes.shape[1]
    for segment in range(len(blocks)):
        for i in range(own):
            left = factors[segment * own + i, shared]
            for j in range(shared):
                left -= factors[segment * own + i, j] * step[j]
            changes[segment, i] = left
        solve_transposed(blocks[segment], changes[segment])
