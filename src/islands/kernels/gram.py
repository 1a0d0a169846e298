"""Inner products of all pairs of columns, without ever holding the columns of the whole record.

The regressor matrix of a large library does not fit into memory (80 730 candidates of the paper's appendix on
100 000 rows: 65 GB). Its Gram matrix does, and forward selection needs nothing else.
"""

import numpy as np
from numba import njit

from islands.kernels.columns import arena_for, evaluate
from islands.kernels.sums import FOLD, dot_chunk


@njit(nogil=True, cache=True, error_model="numpy")
def gram(
    program,
    signals,
    first,
    rows,
    warm_up,  # as in `columns`
    out,  # out, float64 [term, term]
):
    """Compute the inner products of all pairs of terms over all rows, in the written order of `sums`."""
    terms = program.degree.size
    arena, place = arena_for(program, signals.shape[0], warm_up)
    chunk = np.empty((terms, FOLD))
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
                _add_products(flat, terms, filled, fold, out)
                filled = 0
    _add_products(flat, terms, filled, fold, out)
    for i in range(terms):
        for j in range(i):
            out[i, j] = out[j, i]


@njit(nogil=True, cache=True, error_model="numpy")
def _add_products(flat, terms, filled, fold, out):
    rows = np.uint64(filled)
    for i in range(terms):
        for j in range(i, terms):
            out[i, j] += dot_chunk(flat, np.uint64(i * FOLD), flat, np.uint64(j * FOLD), rows, fold)
