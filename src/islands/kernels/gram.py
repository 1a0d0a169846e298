"""Inner products of pairs of columns, without ever holding the columns of the whole record.

The regressor matrix of a large library does not fit into memory (80 730 candidates of the paper's appendix on
100 000 rows: 65 GB). Inner products are numbers, and selection and least squares need nothing else.
"""

import numpy as np
from numba import njit

from islands.kernels.columns import arena_for, evaluate
from islands.kernels.sums import FOLD, dot_chunk


@njit(nogil=True, cache=True, error_model="numpy")
def inner_products(
    program,
    signals,
    first,
    rows,
    warm_up,  # as in `columns`
    pairs,  # int64 [pair, 2]: the terms of each pair
    out,  # out, float64 [pair]
):
    """Compute inner products over all rows in the written order of `sums`.

    A pair's number does not depend on which other terms and pairs are computed with it.
    """
    arena, place = arena_for(program, signals.shape[0], warm_up)
    chunk = np.empty((program.degree.size, FOLD))
    flat = chunk.reshape(-1)
    fold = np.empty(FOLD)
    out[:] = 0.0
    filled = 0
    for segment in range(first.size):
        done = 0
        while done < rows[segment]:
            # A chunk may span a boundary: the fold's order knows rows, not segments.
            lanes = min(FOLD - filled, rows[segment] - done)
            evaluate(program, signals, first[segment] + done, lanes, warm_up, arena, place, chunk, filled)
            done += lanes
            filled += lanes
            if filled == FOLD:
                _add_products(flat, pairs, filled, fold, out)
                filled = 0
    _add_products(flat, pairs, filled, fold, out)


@njit(nogil=True, cache=True, error_model="numpy")
def _add_products(flat, pairs, filled, fold, out):
    rows = np.uint64(filled)
    for pair in range(pairs.shape[0]):
        one, other = np.uint64(pairs[pair, 0] * FOLD), np.uint64(pairs[pair, 1] * FOLD)
        out[pair] += dot_chunk(flat, one, flat, other, rows, fold)
