"""Constrained least squares from inner products: sums over groups of parameters, and general equalities.

A group constraint is ``sum of w_j theta_j over a group = c``; groups are disjoint (the clusters of the paper,
section 3). One member p of each group, the pivot, is eliminated: the other members get the columns
``psi_j - (w_j / w_p) psi_p``, the target becomes ``y - (c / w_p) psi_p``, and the remaining parameters are
free. This is equation (4) in the null space of its constraints, without an inverse.

Any other equality is a row over all terms, from which the pivots of the groups are eliminated first; see
`parameter_reduction`.

Sums over columns that are differences are used for one individual only, so they are folded chunk by chunk.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel
from islands.kernels.regressor_columns import allocate_arena, evaluate
from islands.kernels.simd import VECTOR, broadcast, fold, load, multiply, padded_size, store, subtract
from islands.kernels.summation import CHUNK, dot_chunk

#: Smallest squared pivot, relative to the squared norm of the regressor, that gives at least about six digits
#: of the parameters.
ILL_CONDITIONED = 1e-10

#: A smaller relative squared pivot is a rounding error.
SINGULAR = 1e-13


class ConstrainedFactor(NamedTuple):
    """Cholesky factor of an equilibrated matrix.

    Attributes
    ----------
    lower : ndarray of float64, shape (free, free)
    scale : ndarray of float64, shape (free,)
        Factors by which rows and columns of the matrix were multiplied.
    """

    lower: NDArray[np.float64]
    scale: NDArray[np.float64]


@kernel
def from_gram(gram, terms, reduction, factor, eta):
    """Estimate the free parameters from the Gram matrix.

    Return the smallest relative squared pivot, 0 if the factorisation fails. Below `ILL_CONDITIONED` the
    result needs a correction, below `SINGULAR` it is unusable. ``eta``, out, float64 [free], are the
    parameters; ``factor``, out, is an argument of `correct`.
    """
    free = reduction.free
    count = free.size
    reduced, right = np.empty((count, count)), np.empty(count)
    norms = np.empty(count)
    for a in range(count):
        norms[a] = gram[free[a], free[a]]
        for b in range(a + 1):
            reduced[a, b] = reduced_product(gram, reduction, free[a], free[b])
        right[a] = reduced_target_product(gram, reduction, free[a], terms)
    if reduction.row_pivot.size > 0:
        _reduce_products(gram, terms, reduction, reduced, right)
    least = _factorise(reduced, norms, factor)
    if least > 0.0:
        _solve(factor, right, eta)
    return least


@kernel
def from_columns(program, rows, terms, reduction, factor, eta):
    """Estimate the free parameters from the columns, which are reduced before they are squared.

    Arguments and return value are as in `from_gram`. The last term of the program is the target. The result
    needs a correction.
    """
    free = reduction.free
    count = free.size
    arena, place = allocate_arena(program)
    chunk = padded_size((terms + 1) * CHUNK)
    reduced, right = np.zeros((count, count)), np.zeros(count)
    for index in range(rows.offset.size):
        evaluate(program, rows, index, arena, place, chunk)
        _reduce_columns(chunk, terms, reduction)
        for a in range(count):
            one = free[a] * CHUNK
            right[a] += fold(dot_chunk(chunk, one, chunk, terms * CHUNK))
            for b in range(a + 1):
                reduced[a, b] += fold(dot_chunk(chunk, one, chunk, free[b] * CHUNK))
    norms = np.empty(count)
    for a in range(count):
        norms[a] = reduced[a, a]
    least = _factorise(reduced, norms, factor)
    if least > 0.0:
        _solve(factor, right, eta)
    return least


@kernel
def correct(program, rows, terms, reduction, factor, eta):
    """Correct the free parameters by the corrected seminormal equations (Bjorck 1987).

    The residual is regressed on the columns once more. The last term of the program is the target.
    """
    free = reduction.free
    arena, place = allocate_arena(program)
    chunk = padded_size((terms + 1) * CHUNK)
    target = terms * CHUNK
    right, correction = np.zeros(free.size), np.empty(free.size)
    for index in range(rows.offset.size):
        evaluate(program, rows, index, arena, place, chunk)
        _reduce_columns(chunk, terms, reduction)
        for a in range(free.size):
            _subtract_column(chunk, target, eta[a], free[a] * CHUNK)
        for a in range(free.size):
            right[a] += fold(dot_chunk(chunk, free[a] * CHUNK, chunk, target))
    _solve(factor, right, correction)
    for a in range(free.size):
        eta[a] += correction[a]


@kernel(_nrt=False)
def _reduce_products(gram, terms, reduction, reduced, right):
    """Eliminate the pivots of the equalities from the inner products of the free columns."""
    free, pivots, share = reduction.free, reduction.row_pivot, reduction.row_share
    for a in range(free.size):
        i = free[a]
        for q in range(pivots.size):
            right[a] -= reduction.row_fixed[q] * reduced_product(gram, reduction, i, pivots[q])
            product = reduced_target_product(gram, reduction, pivots[q], terms)
            for other in range(pivots.size):
                product -= reduction.row_fixed[other] * reduced_product(
                    gram, reduction, pivots[q], pivots[other]
                )
            right[a] -= share[q, i] * product
            for b in range(a + 1):
                j = free[b]
                product = reduced_product(gram, reduction, i, pivots[q])
                for other in range(pivots.size):
                    product -= share[other, i] * reduced_product(gram, reduction, pivots[other], pivots[q])
                reduced[a, b] -= (
                    share[q, i] * reduced_product(gram, reduction, pivots[q], j) + share[q, j] * product
                )


@kernel(_nrt=False)
def reduced_target_product(gram, reduction, i, terms):
    """Return the inner product of a column and the target, both without the pivots of the groups."""
    total = reduced_times_column(gram, reduction, i, terms)
    for p in range(terms):
        if reduction.fixed[p] != 0.0:
            total -= reduction.fixed[p] * reduced_times_column(gram, reduction, i, p)
    return total


@kernel(_nrt=False)
def reduced_product(gram, reduction, i, j):
    """Return the inner product of two reduced columns."""
    total = reduced_times_column(gram, reduction, i, j)
    if reduction.pivot[j] >= 0:
        total -= reduction.share[j] * reduced_times_column(gram, reduction, i, reduction.pivot[j])
    return total


@kernel(_nrt=False)
def reduced_times_column(gram, reduction, i, column):
    """Return the inner product of a reduced column and one of the Gram matrix."""
    if reduction.pivot[i] < 0:
        return gram[i, column]
    return gram[i, column] - reduction.share[i] * gram[reduction.pivot[i], column]


@kernel(_nrt=False)
def _reduce_columns(chunk, terms, reduction):
    """Eliminate the pivots from the columns of a chunk and from the target, which follows them."""
    for j in range(terms):
        p = reduction.pivot[j]
        if reduction.fixed[j] != 0.0:
            _subtract_column(chunk, terms * CHUNK, reduction.fixed[j], j * CHUNK)
        if p >= 0 and p != j:
            _subtract_column(chunk, j * CHUNK, reduction.share[j], p * CHUNK)
    for q in range(reduction.row_pivot.size):
        column = reduction.row_pivot[q] * CHUNK
        _subtract_column(chunk, terms * CHUNK, reduction.row_fixed[q], column)
        for j in reduction.free:
            _subtract_column(chunk, j * CHUNK, reduction.row_share[q, j], column)


@kernel(forceinline=True)
def _subtract_column(chunk, at, share, other):
    """Subtract columns in place: ``chunk[at] -= share * chunk[other]``."""
    for row in range(0, CHUNK, 4 * VECTOR):
        part = multiply(broadcast(share, 4), load(chunk, other + row, 4))
        store(chunk, at + row, subtract(load(chunk, at + row, 4), part))


@kernel(_nrt=False)
def _factorise(matrix, norms, factor):
    """Factor the equilibrated matrix, ``lower lower' = scale matrix scale`` (Cholesky), given its lower half.

    Return the smallest squared pivot relative to the squared ``norms``, or 0 if a pivot is not positive.
    """
    lower, scale = factor
    least = np.inf
    for i in range(norms.size):
        if not (matrix[i, i] > 0.0 and np.isfinite(matrix[i, i])):
            return 0.0
        scale[i] = 1.0 / np.sqrt(matrix[i, i])
    for i in range(norms.size):
        for j in range(i + 1):
            total = matrix[i, j] * scale[i] * scale[j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i > j:
                lower[i, j] = total / lower[j, j]
            elif total > 0.0:
                lower[i, i] = np.sqrt(total)
                least = min(least, total * matrix[i, i] / norms[i])
            else:
                return 0.0
    return least


@kernel(_nrt=False)
def _solve(factor, right, solution):
    """Solve ``matrix solution = right`` with the factor of the equilibrated matrix."""
    lower, scale = factor
    count = right.size
    for i in range(count):
        total = right[i] * scale[i]
        for k in range(i):
            total -= lower[i, k] * solution[k]
        solution[i] = total / lower[i, i]
    for i in range(count - 1, -1, -1):
        total = solution[i]
        for k in range(i + 1, count):
            total -= lower[k, i] * solution[k]
        solution[i] = total / lower[i, i]
    for i in range(count):
        solution[i] *= scale[i]
