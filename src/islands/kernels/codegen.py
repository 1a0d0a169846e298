"""Code generation: terms of a pool of nodes to one flat three-address program.

Shared subexpressions are computed once. A temporary row is reused after its last read. Products remain lists
of factors, which the other kernels multiply without a temporary.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import MAX_FACTORS, TEMPORARY, Program
from islands.kernels.jit_cache import kernel

#: Operation of a node that is a lagged signal.
LAGGED = -1

#: Operation of a node that is a constant.
CONSTANT = -2


class NodeArrays(NamedTuple):
    """Expressions as nodes that refer to each other by index; equal expressions share one node.

    Attributes
    ----------
    operation : ndarray of int64, shape (nodes,)
        Instruction of the interpreter, `LAGGED` or `CONSTANT`.
    first, second : ndarray of int64, shape (nodes,)
        Nodes of the operands; channel and lag of a signal; of a constant, the number of its parameter or 0.
    address : ndarray of int64, shape (nodes,)
        Machine address of the row function of a CALL.
    value : ndarray of float64, shape (nodes,)
        Value of a constant.
    factors : ndarray of int64, shape (terms, 4)
        Nodes whose product is the term.
    degree : ndarray of int64, shape (terms,)
        Number of factors of the term.
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
    terms,  # int64 [term]: indices of the terms, in the order of the program
    operand_index,  # int64 [node]: scratch memory, -1 everywhere before and after
):
    """Generate the program of some terms; its operands are the nodes that these need."""
    needed = _collect_nodes(nodes, terms, operand_index)
    count = needed.size
    instructions = constants = 0
    for index in range(count):
        operation = nodes.operation[needed[index]]
        instructions += operation >= 0
        constants += operation == CONSTANT

    factors = np.zeros((terms.size, MAX_FACTORS), np.int64)
    degree = np.empty(terms.size, np.int64)
    for term in range(terms.size):
        degree[term] = nodes.degree[terms[term]]
        for factor in range(degree[term]):
            factors[term, factor] = operand_index[nodes.factors[terms[term], factor]]
    last_use = _find_last_uses(nodes, needed, operand_index, factors, degree)

    # A row is reused after the last read of its value. The target of an instruction never has the row of one
    # of its operands, because a row function may not overlap.
    code = np.empty((instructions, 4), np.int64)
    addresses = np.empty(instructions, np.int64)
    operands = np.empty((count, 2), np.int64)
    values = np.empty(constants, np.float64)
    parameters = np.empty(constants, np.int64)
    free = np.empty(count, np.int64)
    rows, spare, position, constant = constants, 0, 0, 0
    for index in range(count):
        node = needed[index]
        operation, first, second = nodes.operation[node], nodes.first[node], nodes.second[node]
        if operation == LAGGED:
            operands[index, 0], operands[index, 1] = first, second
            continue
        operands[index, 0] = TEMPORARY
        if operation == CONSTANT:
            operands[index, 1] = constant
            values[constant] = nodes.value[node]
            parameters[constant] = first
            constant += 1
            continue
        if spare > 0:
            spare -= 1
            row = free[spare]
        else:
            row = rows
            rows += 1
        operands[index, 1] = row
        a, b = operand_index[first], operand_index[second]
        code[position, 0], code[position, 1] = operation, row
        code[position, 2], code[position, 3] = a, b
        addresses[position] = nodes.address[node]
        position += 1
        for operand in (a, b) if a != b else (a, -1):
            if operand >= 0 and last_use[operand] == index and nodes.operation[needed[operand]] >= 0:
                free[spare] = operands[operand, 1]
                spare += 1
    for index in range(count):
        operand_index[needed[index]] = -1
    return Program(code, addresses, operands, values, parameters, rows, factors, degree)


@kernel
def _find_last_uses(nodes, needed, operand_index, factors, degree):
    """Return the index of the last node that reads each operand; a factor of a term is read at the end."""
    last_use = np.full(needed.size, -1, np.int64)
    for index in range(needed.size):
        node = needed[index]
        if nodes.operation[node] >= 0:
            last_use[operand_index[nodes.first[node]]] = index
            last_use[operand_index[nodes.second[node]]] = index
    for term in range(degree.size):
        for factor in range(degree[term]):
            last_use[factors[term, factor]] = needed.size
    return last_use


@kernel
def _collect_nodes(nodes, terms, operand_index):
    """Return the nodes of the terms, operands before their readers, and fill in ``operand_index``."""
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
                if operand_index[node] < 0 and nodes.operation[node] >= 0:
                    if height + 2 > stack.size:
                        stack = np.append(stack, np.empty_like(stack))
                    # The second operand is pushed first, so that the first one is computed first.
                    for operand in (nodes.second[node], nodes.first[node]):
                        if operand_index[operand] < 0:
                            stack[height] = operand
                            height += 1
                if height == waiting:
                    height -= 1
                    if operand_index[node] < 0:
                        if count == needed.size:
                            needed = np.append(needed, np.empty_like(needed))
                        operand_index[node] = count
                        needed[count] = node
                        count += 1
    return needed[:count]
