"""Evaluation of a whole population (the paper, section 5.2): prune, estimate, simulate.

First, the inner products that the pair table lacks are computed together, each column once. Then terms are
selected: pruning removes some, constraints others. Individuals with equal terms are equal from here on, and a
caller evaluates them once. The result of an individual depends on that individual alone, not on the table and
not on the other individuals.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.characteristic_roots import converges
from islands.kernels.codegen import NodeArrays, generate_program
from islands.kernels.constrained_lstsq import (
    ILL_CONDITIONED,
    SINGULAR,
    ConstrainedFactor,
    correct,
    from_columns,
    from_gram,
)
from islands.kernels.err_selection import INCREMENT, OUTPUT, prune, prune_increments, prune_single
from islands.kernels.jit_cache import kernel
from islands.kernels.pair_table import Pairs, complete_pairs, read_gram
from islands.kernels.parameter_reduction import (
    Groups,
    add_equalities,
    drop_single_members,
    drop_zero_parameters,
    expand,
    get_constraint,
    get_equalities,
    reduce,
)
from islands.kernels.regressor_columns import Rows
from islands.kernels.simulate import Layout, simulate
from islands.kernels.summation import total

# The first three codes are the status codes of `simulate`.

#: Status of an individual: simulated to the end.
OK = 0

#: Status of an individual: the simulation diverged.
DIVERGED = 1

#: Status of an individual: the squared error exceeds the allowed one.
ABANDONED = 2

#: Status of an individual: the columns are linearly dependent.
DEPENDENT = 3

#: Status of an individual: a required group has no member.
INFEASIBLE = 4

#: Status of an individual: pruning and constraints left no term.
NO_TERMS = 5

#: Status of an individual: an inner product is not finite.
OVERFLOW = 6

#: Status of an individual: the record has no more rows than there are parameters.
TOO_FEW_ROWS = 7

#: Status of an individual: a parameter has the wrong sign.
WRONG_SIGN = 8

#: Status of an individual: at constant input the output does not converge (Property 1).
NOT_CONVERGENT = 9


class PopulationContext(NamedTuple):
    """Record, terms and settings that all individuals share.

    Attributes
    ----------
    target : int
        The term that is y(k).
    previous : int
        The term that is y(k-1).
    err_target : int
        What the error reduction ratio of pruning refers to: `OUTPUT`, `INCREMENT` or `OUTPUT_SINGLE`.
    tolerance : float
        Smallest error reduction ratio that survives pruning.
    nodes : NodeArrays
        All terms.
    groups : Groups
    pairs : Pairs
        Inner products that are known; updated. It has room for the pairs of all individuals.
    rows : Rows
        Rows of the record for the estimation.
    layout : Layout
        Intervals of the record for the simulation.
    bound : float
        A larger absolute prediction is a divergence.
    """

    target: int
    previous: int
    err_target: int
    tolerance: float
    nodes: NodeArrays
    groups: Groups
    pairs: Pairs
    rows: Rows
    layout: Layout
    bound: float


class SelectedTerms(NamedTuple):
    """Terms of individuals; `select_terms` writes them.

    Attributes
    ----------
    terms : ndarray of int64, shape (individuals, most terms)
        Terms in the order of their content.
    lengths : ndarray of int64, shape (individuals,)
        Number of terms.
    """

    terms: NDArray[np.int64]
    lengths: NDArray[np.int64]


class PopulationResults(NamedTuple):
    """Arrays that `evaluate_individuals` writes.

    Attributes
    ----------
    theta : ndarray of float64, shape (individuals, most terms)
        Parameters of the terms.
    error : ndarray of float64, shape (individuals,)
        Sum of squared errors; infinite unless the status is `OK`.
    status : ndarray of int64, shape (individuals,)
        `OK` or the reason of the failure.
    """

    theta: NDArray[np.float64]
    error: NDArray[np.float64]
    status: NDArray[np.int64]


def empty_terms(individuals: int, most: int) -> SelectedTerms:
    """Return uninitialised arrays for a number of individuals of at most ``most`` terms."""
    return SelectedTerms(np.empty((individuals, most), np.int64), np.empty(individuals, np.int64))


def empty_results(individuals: int, most: int) -> PopulationResults:
    """Return uninitialised arrays for a number of individuals of at most ``most`` terms."""
    return PopulationResults(
        np.empty((individuals, most)), np.empty(individuals), np.empty(individuals, np.int64)
    )


def evaluate(
    structures: SelectedTerms,
    pruned: NDArray[np.bool_],
    allowed: NDArray[np.float64],
    context: PopulationContext,
    selected: SelectedTerms,
    results: PopulationResults,
) -> None:
    """Complete the table of pairs, select terms and evaluate individuals; ``selected`` is written."""
    complete_pairs(*structures, context.target, context.nodes, context.pairs, context.rows)
    select_terms(structures, pruned, context, selected)
    evaluate_individuals(selected, allowed, context, results)


@kernel
def select_terms(structures, pruned, context, selected):
    """Prune individuals and leave out terms whose parameter must be zero.

    The inner products are in the table of pairs. An individual with an inner product that is not finite keeps
    its terms.

    Parameters
    ----------
    structures : SelectedTerms
        Individuals.
    pruned : ndarray of bool, shape (individuals,)
        Whether the individual is pruned.
    context : PopulationContext
    selected : SelectedTerms
        Written.
    """
    most = structures.terms.shape[1]
    matrix = np.empty((most + 1, most + 1))
    positions = np.empty(most, np.int64)
    for index in range(structures.lengths.size):
        terms = structures.terms[index, : structures.lengths[index]]
        size = _select_positions(terms, pruned[index], context, matrix, positions)
        selected.lengths[index] = size
        for place in range(size):
            selected.terms[index, place] = terms[positions[place]]


@kernel
def evaluate_individuals(selected, allowed, context, results):
    """Estimate and simulate individuals whose terms are selected; the pairs are in the table.

    It takes half of the time of all compilations, so it is a separate kernel.

    Parameters
    ----------
    selected : SelectedTerms
    allowed : ndarray of float64, shape (sizes,)
        A model of a size is abandoned if its sum of squared errors is larger.
    context : PopulationContext
    results : PopulationResults
        Written.
    """
    nodes, layout, bound = context.nodes, context.layout, context.bound
    operand_index = np.full(nodes.operation.size, -1, np.int64)
    most = selected.terms.shape[1]
    matrix = np.empty((most + 1, most + 1))
    lanes = layout.start.size
    squared, diverged, predicted = np.empty(lanes), np.empty(lanes, np.int64), np.empty(0)
    for index in range(selected.lengths.size):
        size = selected.lengths[index]
        chosen, theta = selected.terms[index, :size], results.theta[index, :size]
        results.error[index] = np.inf
        status = _estimate(chosen, context, matrix, operand_index, theta) if size > 0 else NO_TERMS
        if status == OK:
            program = generate_program(nodes, chosen, operand_index)
            limit = allowed[size]
            status = simulate(program, theta, layout, bound, limit, False, squared, diverged, predicted)
            if status == OK:
                results.error[index] = total(squared)
        results.status[index] = status


@kernel
def _select_positions(terms, pruned, context, matrix, positions):
    """Return the number of terms that are left, and their positions in ``positions``.

    ``matrix`` is scratch memory.
    """
    size = terms.size
    for position in range(size):
        positions[position] = position
    if not read_gram(terms, context.target, context.pairs, matrix):
        return size
    if pruned and context.err_target == OUTPUT:
        size = prune(matrix, size, context.tolerance, positions)
    elif pruned and context.err_target == INCREMENT:
        size = _prune_increments(terms, context, matrix, positions)
    elif pruned:
        size = prune_single(matrix, size, context.tolerance, positions)
    if context.groups.sums.size > 0:
        size = drop_single_members(terms, positions, size, context.groups)
    if context.groups.targets.size > 0:
        size = drop_zero_parameters(terms, positions, size, context.groups)
    return size


@kernel
def _prune_increments(terms, context, matrix, positions):
    """Prune the terms that do not explain increments of the output; return how many are left.

    Columns that are zero on the record are left to the estimation, which rejects them.
    """
    size = terms.size
    if _has_zero_column(matrix, size):
        return size
    group, weight, sums, _ = get_constraint(terms, context.groups)
    reduction = reduce(matrix, size, group, weight, sums)
    previous = -1
    for position in range(size):
        if terms[position] == context.previous:
            previous = position
    return prune_increments(matrix, size, reduction, previous, context.tolerance, positions)


@kernel
def _estimate(chosen, context, matrix, operand_index, theta):
    """Estimate the parameters of the chosen terms under the constraint; return the status.

    ``theta``, out, are the parameters. ``matrix`` is scratch memory.
    """
    size = chosen.size
    if not read_gram(chosen, context.target, context.pairs, matrix):
        return OVERFLOW
    group, weight, sums, feasible = get_constraint(chosen, context.groups)
    if not feasible:
        return INFEASIBLE
    if context.rows.count <= size:
        return TOO_FEW_ROWS
    if _has_zero_column(matrix, size):  # a column is zero on the record, and was not pruned
        return DEPENDENT
    reduction = reduce(matrix, size, group, weight, sums)
    if context.groups.targets.size > 0:
        rows = get_equalities(chosen, context.groups)
        reduction, feasible = add_equalities(reduction, matrix, rows, context.groups.targets)
        if not feasible:
            return INFEASIBLE
    count = reduction.free.size
    factor, eta = ConstrainedFactor(np.empty((count, count)), np.empty(count)), np.empty(count)
    least = from_gram(matrix, size, reduction, factor, eta)
    if least < ILL_CONDITIONED:
        terms = np.empty(size + 1, np.int64)
        for position in range(size):
            terms[position] = chosen[position]
        terms[size] = context.target
        program = generate_program(context.nodes, terms, operand_index)
        if least < SINGULAR and from_columns(program, context.rows, size, reduction, factor, eta) < SINGULAR:
            return DEPENDENT
        correct(program, context.rows, size, reduction, factor, eta)
    expand(reduction, eta, theta)
    if context.groups.signs.size > 0:
        for position in range(size):
            if context.groups.signs[chosen[position]] * theta[position] < 0.0:
                return WRONG_SIGN
    if context.groups.output_lag.size > 0 and not _has_equilibria(chosen, theta, context.groups.output_lag):
        return NOT_CONVERGENT
    return OK


@kernel
def _has_equilibria(chosen, theta, output_lag):
    """Return whether the linear output terms converge at constant input."""
    order = 0
    for term in chosen:
        order = max(order, output_lag[term])
    feedback = np.zeros(order)
    for position in range(chosen.size):
        lag = output_lag[chosen[position]]
        if lag > 0:
            feedback[lag - 1] = theta[position]
    return converges(feedback)


@kernel
def _has_zero_column(matrix, size):
    """Return whether the squared norm of one of the columns, on the diagonal of the matrix, is zero."""
    found = False
    for position in range(size):
        found |= matrix[position, position] == 0.0
    return found
