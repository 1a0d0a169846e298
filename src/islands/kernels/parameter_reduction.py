"""Reduction of the parameters of a structure to free ones by sums over groups and general equalities.

A group constraint is ``sum of w_j theta_j over a group = c``; groups are disjoint (the clusters of the paper,
section 3). One member p of each group, the pivot, is eliminated. Any other equality is a row over all terms.
The pivots of the groups are eliminated from it, then one of the remaining parameters by Gauss-Jordan
elimination, in the order of the rows.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: A coefficient that is smaller relative to the numbers it is computed from is a rounding error.
_ROUNDING = 1e-10


class Groups(NamedTuple):
    """Constraint on the parameters of every term in the pool.

    The weighted sum of each group is fixed. Equalities over all terms and signs of parameters are optional.

    Attributes
    ----------
    group : ndarray of int64, shape (terms,)
        Group of the term; -1 if its parameter is free.
    weight : ndarray of float64, shape (terms,)
        Weight of the term's parameter in the sum.
    sums : ndarray of float64, shape (groups,)
        Required sum of each group. A term that is the only member of a group whose sum is zero has the
        parameter zero and is left out.
    required : int
        Number of groups that need at least one member; these are the first ones.
    coefficients : ndarray of float64, shape (terms, equalities)
        Coefficient of the term's parameter in each equality.
    targets : ndarray of float64, shape (equalities,)
        Right-hand side of each equality.
    signs : ndarray of float64, shape (terms,) or (0,)
        1 if the term's parameter must not be negative, -1 if it must not be positive, otherwise 0. Empty if
        no parameter has a sign.
    output_lag : ndarray of int64, shape (terms,) or (0,)
        Lag of a linear output term, otherwise 0. Empty if the output need not converge at constant input.
    """

    group: NDArray[np.int64]
    weight: NDArray[np.float64]
    sums: NDArray[np.float64]
    required: int
    coefficients: NDArray[np.float64]
    targets: NDArray[np.float64]
    signs: NDArray[np.float64]
    output_lag: NDArray[np.int64]


class Reduction(NamedTuple):
    """Elimination of the pivots: how all parameters follow from the free ones.

    Attributes
    ----------
    pivot : ndarray of int64, shape (terms,)
        Pivot of the term's group; -1 if the term has no group.
    share : ndarray of float64, shape (terms,)
        ``w_j / w_p``.
    fixed : ndarray of float64, shape (terms,)
        ``c / w_p`` for a pivot, otherwise 0.
    row_pivot : ndarray of int64, shape (equalities,)
        Term that each independent equality determines; none of them is the pivot of a group.
    row_share : ndarray of float64, shape (equalities, terms)
        ``theta[row_pivot] = row_fixed - sum of row_share * theta`` over the free terms.
    row_fixed : ndarray of float64, shape (equalities,)
    free : ndarray of int64, shape (free,)
        Terms that are not pivots.
    """

    pivot: NDArray[np.int64]
    share: NDArray[np.float64]
    fixed: NDArray[np.float64]
    row_pivot: NDArray[np.int64]
    row_share: NDArray[np.float64]
    row_fixed: NDArray[np.float64]
    free: NDArray[np.int64]


@kernel
def reduce(
    gram,  # float64 [term + 1, term + 1]: inner products of the terms and, last, the target
    terms,
    group,  # int64 [term]: group of each, -1 for none
    weight,  # float64 [term]
    sums,  # float64 [term]: required sum of the term's group
):
    """Choose the pivots: of every group the member with the largest ratio of weight to norm."""
    pivot = np.full(terms, -1, np.int64)
    share = np.zeros(terms)
    fixed = np.zeros(terms)
    for j in range(terms):
        if group[j] < 0 or pivot[j] >= 0:
            continue
        best, largest = j, -1.0
        for i in range(j, terms):
            if group[i] == group[j]:
                size = abs(weight[i]) / np.sqrt(gram[i, i])
                if size > largest:
                    best, largest = i, size
        fixed[best] = sums[j] / weight[best]
        for i in range(j, terms):
            if group[i] == group[j]:
                pivot[i] = best
                share[i] = weight[i] / weight[best]
    is_free, free = np.empty(terms, np.bool_), np.empty(terms, np.int64)
    for j in range(terms):
        is_free[j] = pivot[j] != j
    free = free[: find_true(is_free, free)]
    return Reduction(pivot, share, fixed, np.empty(0, np.int64), np.empty((0, terms)), np.empty(0), free)


@kernel(_nrt=False)
def find_true(values, found):
    """Find the true values; return their number. ``found``, out, are their positions, ascending."""
    count = 0
    for position in range(values.size):
        if values[position]:
            found[count] = position
            count += 1
    return count


@kernel
def add_equalities(
    reduction,  # of the groups
    gram,
    rows,  # float64 [equality, term]
    targets,  # float64 [equality]
):
    """Eliminate one more parameter for every independent equality.

    The pivot is the term with the largest ratio of coefficient to norm. Return the reduction, and whether the
    equalities are consistent.
    """
    terms = rows.shape[1]
    row_pivot, row_share = np.empty(targets.size, np.int64), np.zeros((targets.size, terms))
    row_fixed, rank = np.zeros(targets.size), 0
    is_free = np.zeros(terms, np.bool_)
    for j in reduction.free:
        is_free[j] = True
    for row in range(targets.size):
        coefficient, size = np.zeros(terms), np.zeros(terms)
        rest, height = _eliminate_groups(reduction, rows[row], targets[row], coefficient, size)
        for q in range(rank):
            weight = coefficient[row_pivot[q]]
            coefficient[row_pivot[q]] = 0.0
            rest -= weight * row_fixed[q]
            height += abs(weight * row_fixed[q])
            for j in range(terms):
                if is_free[j]:
                    coefficient[j] -= weight * row_share[q, j]
                    size[j] += abs(weight * row_share[q, j])
        best, largest = -1, 0.0
        for j in range(terms):
            if abs(coefficient[j]) <= _ROUNDING * size[j]:
                coefficient[j] = 0.0
            elif abs(coefficient[j]) / np.sqrt(gram[j, j]) > largest:
                best, largest = j, abs(coefficient[j]) / np.sqrt(gram[j, j])
        if abs(rest) <= _ROUNDING * height:
            rest = 0.0
        if best < 0:
            if rest != 0.0:
                return reduction, False
            continue
        is_free[best] = False
        row_pivot[rank], row_fixed[rank] = best, rest / coefficient[best]
        for j in range(terms):
            if is_free[j]:
                row_share[rank, j] = coefficient[j] / coefficient[best]
        for q in range(rank):
            weight = row_share[q, best]
            row_share[q, best] = 0.0
            row_fixed[q] = _subtract_rounded(row_fixed[q], weight * row_fixed[rank])
            for j in range(terms):
                row_share[q, j] = _subtract_rounded(row_share[q, j], weight * row_share[rank, j])
        rank += 1
    free = np.empty(terms, np.int64)
    return Reduction(
        reduction.pivot,
        reduction.share,
        reduction.fixed,
        row_pivot[:rank].copy(),
        row_share[:rank].copy(),
        row_fixed[:rank].copy(),
        free[: find_true(is_free, free)],
    ), True


@kernel(_nrt=False)
def _eliminate_groups(
    reduction,
    row,  # float64 [term]: coefficients of an equality
    target,
    coefficient,  # out, float64 [term]: coefficients in the parameters that the groups leave
    size,  # out, float64 [term]: sums of the magnitudes of their summands
):
    """Eliminate the parameters of the groups from an equality; return its target and the same sum for it."""
    rest, height = target, abs(target)
    for j in range(row.size):
        p = reduction.pivot[j]
        rest -= row[j] * reduction.fixed[j]
        height += abs(row[j] * reduction.fixed[j])
        if p != j:
            coefficient[j], size[j] = row[j], abs(row[j])
            if p >= 0:
                coefficient[j] -= reduction.share[j] * row[p]
                size[j] += abs(reduction.share[j] * row[p])
    return rest, height


@kernel
def _subtract_rounded(a, b):
    """Return the difference, or 0 if it is a rounding error."""
    difference = a - b
    return 0.0 if abs(difference) <= _ROUNDING * (abs(a) + abs(b)) else difference


@kernel
def find_zeros(
    reduction,
    zero,  # out, bool [term]: whether the parameter is zero in every solution
):
    """Find the parameters that equalities force to be zero."""
    zero[:] = False
    for q in range(reduction.row_pivot.size):
        is_zero = reduction.row_fixed[q] == 0.0
        for j in range(zero.size):
            is_zero &= reduction.row_share[q, j] == 0.0
        zero[reduction.row_pivot[q]] = is_zero
    for p in range(zero.size):
        if reduction.pivot[p] != p:
            continue
        rest = reduction.fixed[p]
        moved, size = np.zeros(zero.size), np.zeros(zero.size)
        for j in range(zero.size):
            if j != p and reduction.pivot[j] == p:
                moved[j] += reduction.share[j]
                size[j] += abs(reduction.share[j])
                for q in range(reduction.row_pivot.size):
                    if reduction.row_pivot[q] == j:
                        moved[j] = 0.0
                        rest = _subtract_rounded(rest, reduction.share[j] * reduction.row_fixed[q])
                        for i in range(zero.size):
                            moved[i] -= reduction.share[j] * reduction.row_share[q, i]
                            size[i] += abs(reduction.share[j] * reduction.row_share[q, i])
        is_zero = rest == 0.0
        for i in range(zero.size):
            is_zero &= not (abs(moved[i]) > _ROUNDING * size[i])
        zero[p] = is_zero


@kernel(_nrt=False)
def expand(reduction, eta, theta):
    """Compute all parameters ``theta`` from the free ones; the pivots complete the sums of their groups."""
    for j in range(theta.size):
        theta[j] = reduction.fixed[j]
    for a in range(eta.size):
        _set_parameter(reduction, reduction.free[a], eta[a], theta)
    for q in range(reduction.row_pivot.size):
        total = reduction.row_fixed[q]
        for a in range(eta.size):
            total -= reduction.row_share[q, reduction.free[a]] * eta[a]
        _set_parameter(reduction, reduction.row_pivot[q], total, theta)


@kernel(_nrt=False)
def _set_parameter(reduction, j, parameter, theta):
    """Set a parameter that is not the pivot of its group, and complete the sum of the group."""
    theta[j] = parameter
    if reduction.pivot[j] >= 0:
        theta[reduction.pivot[j]] -= reduction.share[j] * parameter


@kernel
def drop_single_members(terms, positions, size, groups):
    """Leave out terms that are the only member of a group whose sum is zero; return the number of terms."""
    single = np.zeros(size, np.bool_)
    for i in range(size):
        group = groups.group[terms[positions[i]]]
        if group < 0 or groups.sums[group] != 0.0:
            continue
        single[i] = True
        for j in range(size):
            if j != i and groups.group[terms[positions[j]]] == group:
                single[i] = False
    return _leave_out(positions, size, single)


@kernel
def drop_zero_parameters(terms, positions, size, groups):
    """Leave out terms whose parameter is zero in every solution; return the number of terms."""
    while size > 0:
        chosen = terms[positions[:size]]
        group, weight, sums, _ = get_constraint(chosen, groups)
        norms = np.zeros((size, size))
        for i in range(size):
            norms[i, i] = 1.0
        reduction = reduce(norms, size, group, weight, sums)
        reduction, feasible = add_equalities(reduction, norms, get_equalities(chosen, groups), groups.targets)
        zero = np.empty(size, np.bool_)
        find_zeros(reduction, zero)
        left = _leave_out(positions, size, zero) if feasible else size
        if left == size:  # an inconsistent structure is left as it is
            break
        size = left
    return size


@kernel(_nrt=False)
def _leave_out(positions, size, dropped):
    """Delete the dropped ones of the first ``size`` positions in place; return the number of the others."""
    left = 0
    for i in range(size):
        if not dropped[i]:
            positions[left] = positions[i]
            left += 1
    return left


@kernel
def get_equalities(chosen, groups):
    """Return the coefficients of the chosen terms, one row for each equality."""
    rows = np.empty((groups.targets.size, chosen.size))
    for i in range(chosen.size):
        for row in range(groups.targets.size):
            rows[row, i] = groups.coefficients[chosen[i], row]
    return rows


@kernel
def get_constraint(chosen, groups):
    """Return group, weight and required sum of every term, and whether all required groups have a member."""
    group = np.empty(chosen.size, np.int64)
    weight, sums = np.zeros(chosen.size), np.zeros(chosen.size)
    for i in range(chosen.size):
        group[i] = groups.group[chosen[i]]
        if group[i] >= 0:
            weight[i] = groups.weight[chosen[i]]
            sums[i] = groups.sums[group[i]]
    feasible = True
    for required in range(groups.required):
        present = False
        for i in range(chosen.size):
            present |= group[i] == required
        feasible &= present
    return group, weight, sums, feasible
