"""Variation of genes in prefix code (the paper, section 5.1, Figure 1), compiled.

Two crossovers and two mutations, and random genes. The properties of a gene that is new are computed in
Python. Until then a kernel assumes that the gene makes a structure new, and breeds on, so that one call finds
most of the new genes of a generation. The couples from the first one with a new gene on are then bred again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.gene_table import NO_ROOM, UNKNOWN, find_end, measure_height, number_code
from islands.kernels.jit_cache import kernel

#: Attempts to breed children that differ from their parents. About a quarter of single attempts fail.
_ATTEMPTS = 5

#: Probability that a random tree ends in a leaf before its height limit.
_LEAF_PROBABILITY = 0.15

#: Probability that an inner node of a random tree is a back-shift.
_SHIFT_PROBABILITY = 0.4

#: A call of a kernel is complete.
COMPLETE = 0

#: A call of a kernel has met genes whose properties are unknown.
NEW_GENES = 1

#: A call of a kernel needs more room in the table of genes.
TABLE_FULL = 2

#: A call of a kernel needs more random numbers.
NUMBERS_USED = 3


class Individuals(NamedTuple):
    """Genes of individuals.

    Attributes
    ----------
    genes : ndarray of int64, shape (individuals, most genes)
        Numbers of genes; `UNUSED` after the last gene of an individual.
    lengths : ndarray of int64, shape (individuals,)
        Number of genes.
    """

    genes: NDArray[np.int64]
    lengths: NDArray[np.int64]


#: Mark of an element after the last gene of an individual.
UNUSED = -1


def empty_individuals(count: int, most: int) -> Individuals:
    """Return individuals without genes."""
    return Individuals(np.full((count, most), UNUSED), np.zeros(count, np.int64))


def take(individuals: Individuals, rows: NDArray[np.int64]) -> Individuals:
    """Return some individuals."""
    return Individuals(individuals.genes[rows], individuals.lengths[rows])


class Variation(NamedTuple):
    """Probabilities, limits and symbols of variation.

    Attributes
    ----------
    crossover, high_level, mutation, outer, from_library : float
        Probabilities; see `Settings`.
    max_terms, max_height, initial_height : int
        Limits; see `Settings`.
    fewest, most : int
        Limits of the number of genes of a random individual.
    truncate : bool
        Whether a child with too many genes is truncated; if not, its parent takes its place.
    leaves : ndarray of int64, shape (channels,)
        Symbols of the signals at lag 1: the output, then the inputs.
    shifts, primitives : ndarray of int64
        Symbols of the back-shifts and of the primitives.
    of_inputs : ndarray of bool, shape (primitives,)
        Whether the arguments of a primitive are lags of one input.
    inputs : int
        Number of inputs.
    required : ndarray of int64, shape (requirements,)
        Gene that is added to an individual none of whose genes meets a requirement.
    leads : ndarray of bool, shape (requirements,)
        Whether that gene is the first of the individual; if not, the last.
    library : ndarray of int64, shape (genes,)
        Repaired genes that an outer mutation may insert.
    """

    crossover: float
    high_level: float
    mutation: float
    outer: float
    from_library: float
    max_terms: int
    max_height: int
    initial_height: int
    fewest: int
    most: int
    truncate: bool
    leaves: NDArray[np.int64]
    shifts: NDArray[np.int64]
    primitives: NDArray[np.int64]
    of_inputs: NDArray[np.bool_]
    inputs: int
    required: NDArray[np.int64]
    leads: NDArray[np.bool_]
    library: NDArray[np.int64]


class Draws(NamedTuple):
    """Random numbers of a generation.

    Attributes
    ----------
    numbers : ndarray of float64, shape (draws,)
        Uniform in [0, 1).
    position : ndarray of int64, shape (1,)
        Position of the next number; larger than the number of draws if some were lacking.
    """

    numbers: NDArray[np.float64]
    position: NDArray[np.int64]


@kernel(_nrt=False)
def _draw(draws):
    position = draws.position[0]
    draws.position[0] += 1
    return draws.numbers[position] if position < draws.numbers.size else 0.0


@kernel(_nrt=False)
def _draw_below(bound, draws):
    """Draw an integer from 0 to ``bound - 1``."""
    return np.int64(_draw(draws) * bound)


@kernel
def _draw_individuals(individuals, done, variation, table, draws):
    """Draw random genes of individuals; return a status."""
    lengths = individuals.lengths
    while done[0] < lengths.size:
        index = done[0]
        begin = draws.position[0]
        lengths[index] = variation.fewest + _draw_below(variation.most - variation.fewest + 1, draws)
        for place in range(lengths[index]):
            code = _draw_code(variation, table.arity, draws)
            if draws.position[0] > draws.numbers.size:
                draws.position[0] = begin
                return NUMBERS_USED
            gene = number_code(code, table)
            if gene == NO_ROOM:
                draws.position[0] = begin
                return TABLE_FULL
            individuals.genes[index, place] = gene
        done[0] += 1
    return COMPLETE


@kernel
def _draw_code(variation, arity, draws):
    """Draw a tree of functions and back-shifts by the grow method, up to the initial height."""
    shifts, primitives = variation.shifts, variation.primitives
    code, count = np.empty(32, np.int64), 0
    limits, waiting = np.empty(2 + 2 * variation.initial_height, np.int64), 1
    limits[0] = variation.initial_height
    while waiting > 0:
        waiting -= 1
        limit = limits[waiting]
        # A function of lags has at most two symbols for every level.
        if count + 2 * limit + 4 > code.size:
            larger = np.empty(2 * code.size + 2 * limit + 4, np.int64)
            for place in range(count):
                larger[place] = code[place]
            code = larger
        if limit == 0 or _draw(draws) < _LEAF_PROBABILITY:
            code[count] = variation.leaves[_draw_below(variation.inputs + 1, draws)]
            count += 1
        elif shifts.size > 0 and (primitives.size == 0 or _draw(draws) < _SHIFT_PROBABILITY):
            code[count] = shifts[_draw_below(shifts.size, draws)]
            count += 1
            limits[waiting] = limit - 1
            waiting += 1
        else:
            choice = _draw_below(primitives.size, draws)
            code[count] = primitives[choice]
            count += 1
            if variation.of_inputs[choice]:
                leaf = variation.leaves[1 + _draw_below(variation.inputs, draws)]
                for _ in range(arity[primitives[choice]]):
                    count = _draw_lag(leaf, limit - 1, shifts, draws, code, count)
            else:
                for _ in range(arity[primitives[choice]]):
                    limits[waiting] = limit - 1
                    waiting += 1
    return code[:count]


@kernel(_nrt=False)
def _draw_lag(leaf, limit, shifts, draws, code, count):
    """Add a leaf under random back-shifts to a code; return its new length.

    The innermost back-shift is drawn first.
    """
    begin = count
    while count - begin < limit and shifts.size > 0 and not _draw(draws) < _SHIFT_PROBABILITY:
        code[count] = shifts[_draw_below(shifts.size, draws)]
        count += 1
    for place in range((count - begin) // 2):
        one, other = begin + place, count - 1 - place
        code[one], code[other] = code[other], code[one]
    code[count] = leaf
    return count + 1


@kernel
def breed(
    parents,  # two for every couple, or none for random individuals
    children,  # written; all those from ``done`` on
    done,  # int64 [1]: couples or random individuals that are complete, updated
    variation,
    table,  # updated
    draws,  # updated
):
    """Recombine the couples of a generation, or mutate each parent with the given probability.

    Without parents the children are random individuals, whose genes are not repaired.

    Returns
    -------
    status : int
        `COMPLETE`, or the reason why couples remain.
    """
    if parents.lengths.size == 0:
        return _draw_individuals(children, done, variation, table, draws)
    scratch = Individuals(np.empty((4, children.genes.shape[1]), np.int64), np.empty(4, np.int64))
    couples = parents.lengths.size // 2
    status, certain = COMPLETE, draws.position[0]
    for couple in range(done[0], couples):
        found = _breed_couple(2 * couple, parents, children, scratch, variation, table, draws)
        if draws.position[0] > draws.numbers.size:
            found = NUMBERS_USED
        if found > NEW_GENES:
            status = found if status == COMPLETE else status
            break
        status = max(status, found)
        if status == COMPLETE:
            done[0], certain = couple + 1, draws.position[0]
    draws.position[0] = certain
    return status


@kernel
def _breed_couple(first, parents, children, scratch, variation, table, draws):
    """Breed the two children of a couple; return a status."""
    recombine = _draw(draws) < variation.crossover
    count = 2 if recombine else 1
    status = COMPLETE
    for parent in range(first, first + 2, count):
        if recombine or _draw(draws) < variation.mutation:
            whole = _draw(draws) < (variation.high_level if recombine else variation.outer)
            found = _breed_new(parent, count, whole, parents, children, scratch, variation, table, draws)
            status = max(status, found)
        else:
            _copy(parents, parent, children, parent)
            _add_required(
                children, parent, variation.required, variation.leads, variation.max_terms, table.meets
            )
    return status


@kernel
def _breed_new(first, count, whole, parents, children, scratch, variation, table, draws):
    """Breed children until they have new structures, at most `_ATTEMPTS` times; return a status.

    Two parents recombine, one mutates. ``whole`` is whether whole genes are exchanged.
    """
    status, new = COMPLETE, 0
    for _ in range(_ATTEMPTS):
        if whole and count == 2:
            _exchange_genes(first, parents, scratch, variation.max_terms, variation.truncate, draws)
        else:
            found = _change_genes(first, count, whole, parents, scratch, variation, table, draws)
            if found > NEW_GENES:
                return found
            status = max(status, found)
        for child in range(count):
            _add_required(
                scratch, child, variation.required, variation.leads, variation.max_terms, table.meets
            )
            if new < count and _is_new(scratch, child, parents, first, count, table.term):
                _copy(scratch, child, children, first + new)
                new += 1
        if new >= count:
            break
    for child in range(count - new):
        _copy(scratch, child, children, first + new + child)
    return status


@kernel(_nrt=False)
def _copy(source, one, target, other):
    """Copy an individual; the elements after its last gene keep their values."""
    length = source.lengths[one]
    for place in range(length):
        target.genes[other, place] = source.genes[one, place]
    target.lengths[other] = length


@kernel(_nrt=False)
def _is_new(scratch, child, parents, first, count, terms):
    """Return whether the terms of a child differ from those of each parent."""
    for parent in range(first, first + count):
        if _contains(scratch, child, parents, parent, terms) and _contains(
            parents, parent, scratch, child, terms
        ):
            return False
    return True


@kernel(_nrt=False)
def _contains(individuals, index, others, other, terms):
    """Return whether an individual has all terms of another; an unknown term is in no individual."""
    for place in range(others.lengths[other]):
        term = terms[others.genes[other, place]]
        found = False
        for position in range(individuals.lengths[index]):
            found |= terms[individuals.genes[index, position]] == term != UNKNOWN
        if not found:
            return False
    return True


@kernel(_nrt=False)
def _add_required(individuals, index, required, leads, max_terms, meets):
    """Add the genes that the parameter constraint needs to an individual."""
    genes = individuals.genes[index]
    for requirement in range(required.size):
        length = individuals.lengths[index]
        met = False
        for place in range(length):
            met |= meets[genes[place], requirement]
        if met:
            continue
        length = min(length, max_terms - 1)
        place = length
        if leads[requirement]:
            for later in range(length, 0, -1):
                genes[later] = genes[later - 1]
            place = 0
        genes[place] = required[requirement]
        individuals.lengths[index] = length + 1


@kernel(_nrt=False)
def _exchange_genes(first, parents, scratch, max_terms, truncate, draws):
    """Exchange the genes after a cut point in each parent: the high-level crossover.

    A child with too many genes is truncated or replaced by its parent, as one without genes.
    """
    i = _draw_below(parents.lengths[first] + 1, draws)
    j = _draw_below(parents.lengths[first + 1] + 1, draws)
    for child in range(2):
        one, other = first + child, first + 1 - child
        length = i + parents.lengths[other] - j
        if length == 0 or (length > max_terms and not truncate):
            _copy(parents, one, scratch, child)
            length = scratch.lengths[child] if length == 0 else min(scratch.lengths[child], max_terms)
        else:
            length = min(length, max_terms)
            for place in range(length):
                row, column = (one, place) if place < i else (other, j + place - i)
                scratch.genes[child, place] = parents.genes[row, column]
        scratch.lengths[child] = length
        i, j = j, i


@kernel
def _change_genes(first, count, whole, parents, scratch, variation, table, draws):
    """Change one gene of each parent; return a status.

    Two parents exchange a subtree: the low-level crossover. One parent mutates: a random tree replaces a
    subtree or, in an outer mutation, the whole gene.
    """
    position, begin, end = np.empty(2, np.int64), np.empty(2, np.int64), np.empty(2, np.int64)
    for child in range(count):
        position[child] = _draw_below(parents.lengths[first + child], draws)
    if whole and variation.library.size > 0 and _draw(draws) < variation.from_library:
        _use_library(first, position[0], parents, scratch, variation.library, variation.max_terms, draws)
        return COMPLETE
    for child in range(count):
        gene = parents.genes[first + child, position[child]]
        begin[child], end[child] = table.start[gene], table.start[gene + 1]
        if not whole:
            begin[child] += _draw_below(end[child] - begin[child], draws)
            end[child] = find_end(table.symbols, begin[child], table.arity)
    source, start, stop = table.symbols, begin[1], end[1]
    if count == 1:
        source = _draw_code(variation, table.arity, draws)
        start, stop = 0, source.size
    status = COMPLETE
    for child in range(count):
        _copy(parents, first + child, scratch, child)
        gene = scratch.genes[child, position[child]]
        code = _splice(
            table.symbols,
            table.start[gene],
            begin[child],
            end[child],
            table.start[gene + 1],
            source,
            start,
            stop,
        )
        start, stop = begin[0], end[0]
        # The child keeps the gene of its parent if the new one is too high.
        if measure_height(code, table.arity) <= variation.max_height:
            if draws.position[0] > draws.numbers.size:
                return NUMBERS_USED
            new = number_code(code, table)
            if new == NO_ROOM:
                return TABLE_FULL
            repaired = table.repaired[new]
            if repaired == UNKNOWN:
                status, repaired = NEW_GENES, new
            scratch.genes[child, position[child]] = repaired
    return status


@kernel
def _splice(symbols, first, begin, end, last, source, start, stop):
    """Return the code of a gene with some symbols of a source in place of the subtree."""
    code = np.empty(begin - first + stop - start + last - end, np.int64)
    count = 0
    for place in range(first, begin):
        code[count] = symbols[place]
        count += 1
    for place in range(start, stop):
        code[count] = source[place]
        count += 1
    for place in range(end, last):
        code[count] = symbols[place]
        count += 1
    return code


@kernel(_nrt=False)
def _use_library(parent, position, parents, scratch, library, max_terms, draws):
    """Replace, remove or add a gene; a new one is of the library."""
    genes, length = scratch.genes[0], parents.lengths[parent]
    _copy(parents, parent, scratch, 0)
    gene = library[_draw_below(library.size, draws)]
    kind = _draw_below(4, draws)
    if kind == 0 and length > 1:
        for place in range(position, length - 1):
            genes[place] = genes[place + 1]
        scratch.lengths[0] = length - 1
    elif kind == 1 and length < max_terms:
        genes[length] = gene
        scratch.lengths[0] = length + 1
    else:
        genes[position] = gene
