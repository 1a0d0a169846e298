"""Forward orthogonal regression by error reduction ratio (FROE), equation (6), on inner products alone.

Selecting the regressor with the largest error reduction ratio and orthogonalising the others against it is a
Cholesky factorisation of the Gram matrix, pivoted by that ratio: rows of the record are never touched again.
"""

import numpy as np

from islands.kernels.jit_cache import kernel

#: A candidate whose squared norm has shrunk to this share can't be told from those selected: in float64 the
#: Gram matrix knows sixteen digits of the squares, so less than six of what is left.
DEPENDENT = 1e-10


@kernel
def select(
    gram,  # float64 [candidate + 1, candidate + 1]: inner products of the candidates and, last, the target
    candidates,  # how many; gram may be larger, the target stands at this index
    tolerance,  # stop when no candidate left has a larger error reduction ratio
    limit,  # stop at this number
    order,  # out, int64 [limit]
    err,  # out, float64 [limit]: error reduction ratio of each, on top of those before it
):
    """Select candidates one after the other and return how many; ties go to the first candidate."""
    energy = gram[candidates, candidates]
    if not (energy > 0.0 and np.isfinite(energy)):
        return 0
    scale = np.empty(candidates)
    left = np.empty(candidates)
    correlation = np.empty(candidates)
    for j in range(candidates):
        # What is zero, or too large for its square to be a number, explains nothing and spoils nothing.
        usable = gram[j, j] > 0.0 and np.isfinite(gram[j, j])
        scale[j] = 1.0 / np.sqrt(gram[j, j]) if usable else 0.0
        left[j] = 1.0 if usable else 0.0
        correlation[j] = gram[j, candidates] * scale[j] if usable else 0.0
    rows = np.empty((limit, candidates))
    selected = 0
    while selected < limit:
        best, ratio = -1, tolerance
        for j in range(candidates):
            if left[j] > DEPENDENT:
                share = correlation[j] * correlation[j] / left[j] / energy
                if share > ratio:
                    best, ratio = j, share
        if best < 0:
            break
        pivot = np.sqrt(left[best])
        gain = correlation[best] / pivot
        for j in range(candidates):
            if left[j] > 0.0:
                row = gram[best, j] * scale[best] * scale[j]
                for earlier in range(selected):
                    row -= rows[earlier, best] * rows[earlier, j]
                row /= pivot
                rows[selected, j] = row
                correlation[j] -= row * gain
                left[j] -= row * row
        left[best] = 0.0
        order[selected] = best
        err[selected] = ratio
        selected += 1
    return selected


@kernel
def prune(gram, terms, tolerance, kept):
    """Find the terms whose error reduction ratio exceeds the tolerance (section 5.2); return how many.

    ``kept``, out, int64 [term], are their positions, ascending.
    """
    # All are orthogonalised before any leaves (section 2): one that explains little by itself may let the
    # next explain much.
    order, err = np.empty(terms, np.int64), np.empty(terms)
    selected = select(gram, terms, 0.0, terms, order, err)
    stays = np.zeros(terms, np.bool_)
    for rank in range(selected):
        stays[order[rank]] = err[rank] > tolerance
    found = np.flatnonzero(stays)
    kept[: found.size] = found
    return found.size
