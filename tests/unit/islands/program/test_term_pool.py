"""The pool recognises equal expressions, so that each is computed once."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.kernels import codegen
from islands.kernels.codegen import CONSTANT, LAGGED
from islands.kernels.interpreter import (
    CALL,
    MAX_FACTORS,
    SIGN,
)
from islands.models.regressor import regressor
from islands.program.primitive_functions import row_address
from islands.program.term_pool import TermPool, link
from support.oracles import NUMBERS
from support.strategies import regressors, signals

several = st.lists(regressors(), min_size=1, max_size=5)


def made(text, table=PRIMITIVES):
    return regressor(parse(text, table))[1]


def used_nodes(pool):
    """Return the nodes of the pool as tuples, without unused ones."""
    nodes = pool.nodes
    count = len(pool._indices)
    columns = (nodes.operation, nodes.first, nodes.second, nodes.address, nodes.value)
    return list(zip(*(column[:count].tolist() for column in columns), strict=True))


def node_values(pool, signal):
    """Evaluate every node on single values."""
    called = {row_address(entry): entry for entry in PRIMITIVES.values()}
    found = []
    for operation, first, second, address, number in used_nodes(pool):
        if operation == LAGGED:
            found.append(signal(first, second))
        elif operation == CONSTANT:
            found.append(number)
        elif operation == CALL:
            found.append(called[address].scalar(*(found[first], found[second])[: called[address].arity]))
        else:
            operands = (found[first],) if operation == SIGN else (found[first], found[second])
            found.append(NUMBERS[operation](*operands))
    return found


@pytest.mark.ci
@given(several, signals())
def test_factors_of_a_term_multiply_to_the_value_of_the_expression(terms, signal):
    try:
        expected = [value(item.expression, signal) for item in terms]
    except ValueError:  # the sine of an infinite value
        assume(False)
    pool = TermPool()
    indices = pool.terms(terms)
    nodes = node_values(pool, signal)
    for number, wanted in zip(indices, expected, strict=True):
        degree = pool.nodes.degree[number]
        assert 1 <= degree <= MAX_FACTORS
        found = math.prod(nodes[factor] for factor in pool.nodes.factors[number, :degree])
        np.testing.assert_array_equal(found, wanted)


@given(several)
def test_equal_expressions_share_a_node_and_operands_precede_readers(terms):
    pool = TermPool()
    pool.terms(terms)
    nodes = used_nodes(pool)
    assert len(set(nodes)) == len(nodes)
    for number, (operation, first, second, *_) in enumerate(nodes):
        if operation >= 0:
            assert max(first, second) < number


@given(several, several)
def test_known_terms_keep_their_index_and_add_no_node(terms, others):
    pool = TermPool()
    indices = pool.terms(terms).tolist()
    pool.terms(others)
    size, nodes = len(pool), len(used_nodes(pool))
    assert pool.terms(terms).tolist() == indices
    assert (len(pool), len(used_nodes(pool))) == (size, nodes)
    texts = [item.text for item in terms]
    assert len(set(indices)) == len(set(texts))
    assert size == len({item.text for item in (*terms, *others)})


@pytest.mark.ci
@given(several, several)
def test_program_does_not_depend_on_other_terms_of_the_pool(terms, others):
    """The nodes have other indices, the program is the same."""
    pool = TermPool()
    pool.terms(others)
    indices = pool.terms(terms)
    operand_index = np.full(pool.nodes.operation.size, -1, np.int64)
    for found, expected in zip(
        codegen.generate_program(pool.nodes, indices, operand_index), link(terms), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    assert (operand_index == -1).all()


def test_deep_expression_and_many_nodes_give_a_program():
    """The expression is deeper than the initial stack, and has more nodes than the initial array."""
    text = "u(k-1)"
    for lag in range(1, 60):
        text = f"tanh({text} - y(k-{lag}))"
    assert len(link([made(text)]).code) == 2 * 59
    wide = link([made(" + ".join(f"abs(u(k-{lag}) - 1)" for lag in range(1, 200)))])
    assert len(wide.code) == 199 + 199 + 198


def test_functions_with_one_name_in_two_pools_keep_their_addresses():
    one, other = primitive("own", lambda a: a + 1.0), primitive("own", lambda a: a + 2.0)
    found = [
        link([made("own(u(k-1))", {**PRIMITIVES, "own": entry})]).addresses.tolist() for entry in (one, other)
    ]
    assert found == [[row_address(one)], [row_address(other)]]
    assert found[0] != found[1]
