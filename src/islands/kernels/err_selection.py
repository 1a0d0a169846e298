"""Forward orthogonal regression by error reduction ratio (FROE), equation (6), from inner products only.

Selecting the regressor with the largest error reduction ratio and orthogonalising the others against it is a
Cholesky factorisation of the Gram matrix, pivoted by that ratio. The rows of the record are not needed.
"""

import numpy as np

from islands.kernels.constrained_lstsq import reduced_product, reduced_target_product
from islands.kernels.jit_cache import kernel
from islands.kernels.parameter_reduction import find_true

#: A candidate whose squared norm has shrunk to this fraction counts as dependent on the selected ones: in
#: float64 the Gram matrix has sixteen digits of the squares, so fewer than six of the remainder.
DEPENDENT = 1e-10

#: Error reduction ratios with a smaller relative difference are equal: rounding must not decide between them.
TIE = 1e-9

#: Rounding error of the inner products, relative to the norms. The orthogonalisation against a candidate that
#: depends on others nearly divides it by the norm that is left. A ratio has no digit left if the candidates
#: before it explain the target, and few if they nearly explain the candidate.
_ROUNDING = 1e-14

#: What the error reduction ratio refers to: rules of `prune`, `prune_increments` and `prune_single`.
OUTPUT, INCREMENT, OUTPUT_SINGLE = 0, 1, 2


@kernel
def select(
    gram,  # float64 [candidate + 1, candidate + 1]: inner products of the candidates and, last, the target
    candidates,  # their number; gram may be larger, the target has this index
    tolerance,  # stop when no remaining candidate has a larger error reduction ratio
    limit,  # stop at this number of selected candidates
    order,  # out, int64 [limit]
    err,  # out, float64 [limit]: error reduction ratio of each, given those selected before it
):
    """Select candidates one after the other and return their number.

    Error reduction ratios that differ by their rounding errors tie, and the first candidate is selected.
    """
    energy = gram[candidates, candidates]
    if not (energy > 0.0 and np.isfinite(energy)):
        return 0
    norm = np.sqrt(energy)
    scale = np.empty(candidates)
    left = np.empty(candidates)
    correlation = np.empty(candidates)
    for j in range(candidates):
        # A column that is zero, or whose square overflows, is never selected and does not affect the others.
        usable = gram[j, j] > 0.0 and np.isfinite(gram[j, j])
        scale[j] = 1.0 / np.sqrt(gram[j, j]) if usable else 0.0
        left[j] = 1.0 if usable else 0.0
        correlation[j] = gram[j, candidates] * scale[j] if usable else 0.0
    rows = np.empty((limit, candidates))
    selected, rounding = 0, _ROUNDING
    while selected < limit:
        best, ratio, largest = -1, tolerance, tolerance
        for j in range(candidates):
            if left[j] > DEPENDENT:
                share = correlation[j] * correlation[j] / left[j] / energy
                product, error = abs(correlation[j]) / norm, max(TIE, rounding / left[j])
                least = max(0.0, product - rounding) ** 2 / left[j] * (1.0 - error)
                if least > largest or (best < 0 and share > tolerance):
                    best, ratio = j, share
                    largest = (product + rounding) ** 2 / left[j] * (1.0 + error)
        if best < 0:
            break
        pivot = np.sqrt(left[best])
        rounding = max(rounding, _ROUNDING / pivot)
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
    """Find the terms whose error reduction ratio exceeds the tolerance (section 5.2); return their number.

    ``kept``, out, int64 [term], are their positions, ascending.
    """
    # All terms are orthogonalised before any is removed (section 2): a term that explains little alone may
    # make the next one explain much.
    order, err = np.empty(terms, np.int64), np.empty(terms)
    selected = select(gram, terms, 0.0, terms, order, err)
    kept_terms = np.zeros(terms, np.bool_)
    for rank in range(selected):
        kept_terms[order[rank]] = err[rank] > tolerance
    return find_true(kept_terms, kept)


@kernel
def prune_single(gram, terms, tolerance, kept):
    """Find the terms whose error reduction ratio exceeds the tolerance, each alone; return their number.

    ``kept``, out, int64 [term], are their positions, ascending. The ratio is the squared correlation of a
    term with the target: no term is orthogonalised against the others.
    """
    kept_terms = np.zeros(terms, np.bool_)
    energy = gram[terms, terms]
    for position in range(terms):
        product = gram[position, terms]
        # A column that is zero has the product zero, so it is removed.
        kept_terms[position] = product * product > tolerance * gram[position, position] * energy
    return find_true(kept_terms, kept)


@kernel
def prune_increments(
    gram,  # float64 [term + 1, term + 1]: inner products of the terms and, last, of y(k)
    terms,
    reduction,  # null space of the constraints on the terms
    previous,  # position of y(k-1) among the terms, -1 if it is missing
    tolerance,
    kept,  # out, int64 [term]: positions of the terms that stay, ascending
):
    """Find the terms that explain increments of the output; return their number.

    The error reduction ratio is that of the columns of the null space, and its target is y(k) without the
    part that the constraints fix; without constraints the target is y(k) - y(k-1). On an oversampled record
    y(k-1) explains nearly all of y(k), so that the ratio of every other term on y(k) itself is tiny. y(k-1)
    stays, and the pivot of a group stays with any other member.
    """
    free, fixed = reduction.free, reduction.fixed
    if free.size == terms and previous >= 0:
        fixed[previous] = 1.0
    count = free.size
    reduced = np.empty((count + 1, count + 1))
    energy = gram[terms, terms]
    for p in range(terms):
        if fixed[p] != 0.0:
            energy -= 2.0 * fixed[p] * gram[p, terms]
            for q in range(terms):
                energy += fixed[p] * fixed[q] * gram[p, q]
    reduced[count, count] = energy
    for a in range(count):
        for b in range(a + 1):
            reduced[a, b] = reduced[b, a] = reduced_product(gram, reduction, free[a], free[b])
        along = reduced_target_product(gram, reduction, free[a], terms)
        reduced[a, count] = reduced[count, a] = along
    order, err = np.empty(count, np.int64), np.empty(count)
    selected = select(reduced, count, 0.0, count, order, err)
    stays = np.empty(terms, np.bool_)
    for p in range(terms):
        stays[p] = fixed[p] != 0.0
    for rank in range(selected):
        if err[rank] > tolerance:
            term = free[order[rank]]
            stays[term] = True
            if reduction.pivot[term] >= 0:
                stays[reduction.pivot[term]] = True
    return find_true(stays, kept)
