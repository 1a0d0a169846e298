"""The linker: terms of a store of nodes in, one flat three-address program out.

Shared subexpressions are computed once, temporary rows are reused as soon as nobody reads them any more, and
products stay lists of factors that the other kernels multiply on the fly.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import MAX_FACTORS, TEMPORARY, Program
from islands.kernels.jit_cache import kernel

#: Nodes that are no instruction: a signal some samples back, and a number.
LAGGED, CONSTANT = -1, -2


class NodeArrays(NamedTuple):
    """Expressions as nodes that refer to each other by number; equal expressions are one node.

    Attributes
    ----------
    operation : ndarray of int64, shape (nodes,)
        An instruction of the machine, `LAGGED` or `CONSTANT`.
    first, second : ndarray of int64, shape (nodes,)
        Operands, nodes themselves; of a signal its channel and lag.
    address : ndarray of int64, shape (nodes,)
        Machine address of a CALL's row function.
    value : ndarray of float64, shape (nodes,)
        The number of a constant.
    factors : ndarray of int64, shape (terms, 4)
        Nodes whose product is the term.
    degree : ndarray of int64, shape (terms,)
        How many factors a term has.
    """

    operation: NDArray[np.int64]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    address: NDArray[np.int64]
    value: NDArray[np.float64]
    factors: NDArray[np.int64]
    degree: NDArray[np.int64]


@kernel
def generate_program(
    nodes,
    terms,  # int64 [term]: numbers of the terms, in the order of the program's
    place,  # int64 [node]: room, -1 everywhere before and after
):
    """Link terms; a node is an operand of the program once it is needed."""
    needed = _needed(nodes, terms, place)
    count = needed.size
    instructions = constants = 0
    for index in range(count):
        operation = nodes.operation[needed[index]]
        instructions += operation >= 0
        constants += operation == CONSTANT

    last_use = np.full(count, -1, np.int64)
    for index in range(count):
        node = needed[index]
        if nodes.operation[node] >= 0:
            last_use[place[nodes.first[node]]] = index
            last_use[place[nodes.second[node]]] = index
    factors = np.zeros((terms.size, MAX_FACTORS), np.int64)
    degree = np.empty(terms.size, np.int64)
    for term in range(terms.size):
        degree[term] = nodes.degree[terms[term]]
        for factor in range(degree[term]):
            operand = place[nodes.factors[terms[term], factor]]
            factors[term, factor] = operand
            last_use[operand] = count

    # A row is taken again when its value is dead. A target never takes the row of an operand of the same
    # instruction: a row function may not overlap.
    code = np.empty((instructions, 4), np.int64)
    addresses = np.empty(instructions, np.int64)
    operands = np.empty((count, 2), np.int64)
    values = np.empty(constants, np.float64)
    free = np.empty(count, np.int64)
    rows, spare, position, constant = constants, 0, 0, 0
    for index in range(count):
        node = needed[index]
        operation, first, second = nodes.operation[node], nodes.first[node], nodes.second[node]
        if operation == LAGGED:
            operands[index] = first, second
            continue
        operands[index, 0] = TEMPORARY
        if operation == CONSTANT:
            operands[index, 1] = constant
            values[constant] = nodes.value[node]
            constant += 1
            continue
        if spare > 0:
            spare -= 1
            row = free[spare]
        else:
            row = rows
            rows += 1
        operands[index, 1] = row
        a, b = place[first], place[second]
        code[position] = operation, row, a, b
        addresses[position] = nodes.address[node]
        position += 1
        for operand in (a, b) if a != b else (a, -1):
            if operand >= 0 and last_use[operand] == index and nodes.operation[needed[operand]] >= 0:
                free[spare] = operands[operand, 1]
                spare += 1
    for index in range(count):
        place[needed[index]] = -1
    return Program(code, addresses, operands, values, rows, factors, degree)


@kernel
def _needed(nodes, terms, place):
    """Return the nodes that terms are made of, operands before what reads them, and number their places."""
    needed = np.empty(64, np.int64)
    stack = np.empty(64, np.int64)
    count = 0
    for term in terms:
        for factor in range(nodes.degree[term]):
            stack[0] = nodes.factors[term, factor]
            height = 1
            while height > 0:
                node = stack[height - 1]
                waiting = height
                if place[node] < 0 and nodes.operation[node] >= 0:
                    if height + 2 > stack.size:
                        stack = np.append(stack, np.empty_like(stack))
                    # The second first: the first is then computed before it.
                    for operand in (nodes.second[node], nodes.first[node]):
                        if place[operand] < 0:
                            stack[height] = operand
                            height += 1
                if height == waiting:
                    height -= 1
                    if place[node] < 0:
                        if count == needed.size:
                            needed = np.append(needed, np.empty_like(needed))
                        place[node] = count
                        needed[count] = node
                        count += 1
    return needed[:count]
