"""Evaluation of a whole population in one call (the paper, section 5.2): prune, estimate, simulate.

First the inner products that the table of pairs still misses are computed together, each column once; then
one individual after the other is evaluated. What comes out depends on the individuals alone: not on the
table, not on each other.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.codegen import link
from islands.kernels.constrained_lstsq import (
    ILL_CONDITIONED,
    SINGULAR,
    ConstrainedFactor,
    correct,
    expand,
    from_columns,
    from_gram,
    reduce,
)
from islands.kernels.err_selection import prune
from islands.kernels.gram import gram, inner_products
from islands.kernels.jit_cache import kernel
from islands.kernels.pair_table import find_pair, pair_key
from islands.kernels.simulate import COMPLETE, simulate
from islands.kernels.summation import total

#: What became of an individual. The first three are those of `simulate`: complete, diverged, beyond what is
#: allowed.
OK, DIVERGED, ABANDONED, DEPENDENT, INFEASIBLE, NO_TERMS, OVERFLOW, TOO_FEW_ROWS = range(8)


class Groups(NamedTuple):
    """The constraint on the parameters of every term in the store.

    Attributes
    ----------
    group : ndarray of int64, shape (terms,)
        The group whose parameters' sum is fixed; -1: the parameter is free.
    weight : ndarray of float64, shape (terms,)
        The term's weight in that sum.
    wanted : ndarray of float64, shape (groups,)
        The sums. A term that is alone in a group that sums to zero has the parameter zero: it is left out.
    required : int
        So many groups, the first ones, have to be there.
    """

    group: NDArray[np.int64]
    weight: NDArray[np.float64]
    wanted: NDArray[np.float64]
    required: int


@kernel
def evaluate(
    structures,  # int64 [individual, most terms]: terms in the order of their content
    sizes,  # int64 [individual]
    pruned,  # bool [individual]: whether it is pruned
    target,  # the term that is y(k)
    tolerance,  # smallest error reduction ratio that survives pruning
    nodes,
    groups,
    pairs,
    rows,
    layout,
    bound,
    allowed,  # float64 [size]: a larger sum of squared errors of a model of that size need not be known
    kept,  # out, int64 [individual, most terms]: positions of the terms that are left, ascending
    lengths,  # out, int64 [individual]: how many are left
    theta,  # out, float64 [individual, most terms]
    error,  # out, float64 [individual]: sum of squared errors
    ending,  # out, int64 [individual]: what became of it
):
    """Evaluate individuals; the table has room for all their pairs."""
    place = np.full(nodes.operation.size, -1, np.int64)
    _fill(structures, sizes, target, nodes, pairs, rows, place)
    most = structures.shape[1]
    matrix = np.empty((most + 1, most + 1))
    lanes = layout.start.size
    squared, diverged, nothing = np.empty(lanes), np.empty(lanes, np.int64), np.empty(0)
    patient = np.bool_(False)  # not the constant: the compiler would make another simulation of it
    for index in range(sizes.size):
        terms, positions = structures[index], kept[index]
        error[index] = np.inf
        size = sizes[index]
        positions[:size] = np.arange(size)
        lengths[index] = size
        if not _read(terms, positions, size, target, pairs, matrix):
            ending[index] = OVERFLOW
            continue
        if pruned[index]:
            size = prune(matrix, size, tolerance, positions)
        if groups.wanted.size > 0:
            size = _without_lone(terms, positions, size, groups)
        lengths[index] = size
        if size == 0:
            ending[index] = NO_TERMS
            continue
        chosen = terms[positions[:size]]
        group, weight, wanted, feasible = _constraint(chosen, groups)
        if not feasible:
            ending[index] = INFEASIBLE
            continue
        if rows.count <= size:
            ending[index] = TOO_FEW_ROWS
            continue
        _read(terms, positions, size, target, pairs, matrix)
        if not np.diag(matrix)[:size].all():  # zero on the record, and not pruned
            ending[index] = DEPENDENT
            continue
        reduction = reduce(matrix, size, group, weight, wanted)
        count = reduction.free.size
        factor, eta = ConstrainedFactor(np.empty((count, count)), np.empty(count)), np.empty(count)
        least = from_gram(matrix, size, reduction, factor, eta)
        if least < ILL_CONDITIONED:
            program = link(nodes, np.append(chosen, target), place)
            if least < SINGULAR and from_columns(program, rows, size, reduction, factor, eta) < SINGULAR:
                ending[index] = DEPENDENT
                continue
            correct(program, rows, size, reduction, factor, eta)
        parameters = theta[index, :size]
        expand(reduction, eta, parameters)
        program = link(nodes, chosen, place)
        limit = allowed[size]
        ending[index] = simulate(
            program, parameters, layout, bound, limit, patient, squared, diverged, nothing
        )
        if ending[index] == COMPLETE:
            error[index] = total(squared)


@kernel
def _fill(structures, sizes, target, nodes, pairs, rows, place):
    """Compute the inner products that the table misses."""
    local = np.full(nodes.degree.size, -1, np.int64)
    terms = np.empty_like(local)
    most = np.sum((sizes + 1) * (sizes + 2) // 2)
    missing, places = np.empty((most, 2), np.int64), np.empty(most, np.int64)
    count = used = 0
    for index in range(sizes.size):
        size = sizes[index]
        for i in range(size + 1):
            one = structures[index, i] if i < size else target
            for j in range(i, size + 1):
                other = structures[index, j] if j < size else target
                key = pair_key(one, other)
                at = find_pair(pairs, key)
                if pairs.keys[at] == key:
                    continue
                pairs.keys[at] = key
                pairs.taken[0] += 1
                for term in (one, other):
                    if local[term] < 0:
                        local[term] = used
                        terms[used] = term
                        used += 1
                places[count] = at
                missing[count] = local[one], local[other]
                count += 1
    if count == 0:
        return
    program = link(nodes, terms[:used], place)
    if count == used * (used + 1) // 2:
        products = np.empty((used, used))
        gram(program, rows, products)
        for index in range(count):
            pairs.values[places[index]] = products[missing[index, 0], missing[index, 1]]
        return
    numbers = np.empty(count)
    inner_products(program, rows, missing[:count], numbers)
    for index in range(count):
        pairs.values[places[index]] = numbers[index]


@kernel
def _read(terms, positions, size, target, pairs, gram):
    """Read a Gram matrix, the target last, from the table; False where a number of it is not finite."""
    finite = True
    for i in range(size + 1):
        one = terms[positions[i]] if i < size else target
        for j in range(i, size + 1):
            other = terms[positions[j]] if j < size else target
            gram[i, j] = pairs.values[find_pair(pairs, pair_key(one, other))]
            gram[j, i] = gram[i, j]
            finite &= np.isfinite(gram[i, j])
    return finite


@kernel
def _without_lone(terms, positions, size, groups):
    """Leave out a term that is alone in a group whose sum is zero."""
    lone = np.zeros(size, np.bool_)
    for i in range(size):
        group = groups.group[terms[positions[i]]]
        if group < 0 or groups.wanted[group] != 0.0:
            continue
        lone[i] = True
        for j in range(size):
            if j != i and groups.group[terms[positions[j]]] == group:
                lone[i] = False
    left = positions[:size][~lone]
    positions[: left.size] = left
    return left.size


@kernel
def _constraint(chosen, groups):
    """Return group, weight and wanted sum of every term, and whether the required group is there."""
    group = np.empty(chosen.size, np.int64)
    weight, wanted = np.zeros(chosen.size), np.zeros(chosen.size)
    for i in range(chosen.size):
        group[i] = groups.group[chosen[i]]
        if group[i] >= 0:
            weight[i] = groups.weight[chosen[i]]
            wanted[i] = groups.wanted[group[i]]
    feasible = True
    for needed in range(groups.required):
        feasible &= np.any(group == needed)
    return group, weight, wanted, feasible
