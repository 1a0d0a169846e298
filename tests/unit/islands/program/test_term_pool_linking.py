"""Generated programs, executed by an interpreter of ten lines."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.kernels.interpreter import (
    CALL,
    MAX_FACTORS,
    SIGN,
    TEMPORARY,
)
from islands.models.regressor import regressor
from islands.program.primitive_functions import row_address
from islands.program.term_pool import link
from support.oracles import NUMBERS
from support.strategies import regressors, signals

several = st.lists(regressors(), min_size=1, max_size=4)


@pytest.fixture(scope="module")
def called():
    return {row_address(entry): entry for entry in PRIMITIVES.values()}


def interpreted(program, signal, operations, called, product=math.prod):
    """Execute a program on single values; return the terms and the computed values in order."""
    rows = [*program.constants.tolist(), *[None] * (program.temporaries - len(program.constants))]
    computed = []

    def read(operand):
        channel, lag = program.operands[operand].tolist()
        return rows[lag] if channel == TEMPORARY else signal(channel, lag)

    for (operation, target, *operands), address in zip(program.code, program.addresses, strict=True):
        arity = called[address].arity if operation == CALL else 1 if operation == SIGN else 2
        compute = called[address].scalar if operation == CALL else operations[operation]
        computed.append(compute(*[read(operand) for operand in operands[:arity]]))
        rows[target] = computed[-1]
    factors = zip(program.factors, program.degree, strict=True)
    return [product(map(read, several[:degree])) for several, degree in factors], computed


@given(several, signals())
def test_program_computes_its_terms_despite_reused_rows(called, terms, signal):
    try:
        expected = [value(item.expression, signal) for item in terms]
    except ValueError:  # the sine of an infinite value
        assume(False)
    found, _ = interpreted(link(terms), signal, NUMBERS, called)
    np.testing.assert_array_equal(found, expected)


@given(several)
def test_no_expression_is_computed_twice(called, terms):
    def written(name):
        return lambda *arguments: f"{name}({', '.join(map(str, arguments))})"

    class Named:
        def __init__(self, entry):
            self.arity, self.scalar = entry.arity, written(entry.name)

    symbols = {address: Named(entry) for address, entry in called.items()}
    operations = {operation: written(f"instruction {operation}") for operation in NUMBERS}
    program = link(terms)
    _, computed = interpreted(program, lambda *place: f"x{place}", operations, symbols, product=list)
    assert len(set(computed)) == len(computed) == len(program.code)


def linked(*texts):
    return link([regressor(parse(text))[1] for text in texts])


def operations(program):
    return program.code[:, 0].tolist()


def test_row_is_reused_after_the_last_read_of_its_value():
    text = "u(k-1)"
    for _ in range(10):
        text = f"tanh({text} + y(k-1))"
    program = linked(text)
    assert len(program.code) == 20
    assert program.temporaries == 2


def test_empty_list_of_terms_gives_an_empty_program():
    program = link([])
    assert [array.shape for array in (program.code, program.operands, program.factors, program.degree)] == [
        (0, 4),
        (0, 2),
        (0, MAX_FACTORS),
        (0,),
    ]
