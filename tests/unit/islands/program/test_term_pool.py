"""The store knows an expression when it meets it again, and so computes it once."""

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.kernels import codegen
from islands.kernels.codegen import CONSTANT, LAGGED
from islands.kernels.interpreter import (
    CALL,
    MAX_FACTORS,
    SIGN,
)
from islands.model.expression import Constant, Lagged, value
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES, primitive
from islands.model.regressor import regressor
from islands.program.primitive_functions import row_address
from islands.program.term_pool import TermPool, link
from support.oracles import NUMBERS
from support.strategies import regressors, signals

several = st.lists(regressors(), min_size=1, max_size=5)


def made(text, table=PRIMITIVES):
    return regressor(parse(text, table))[1]


def taken(store):
    """Return the store's nodes as tuples; nodes that nobody has taken are left out."""
    nodes = store.nodes
    count = len(store._indices)
    columns = (nodes.operation, nodes.first, nodes.second, nodes.address, nodes.value)
    return list(zip(*(column[:count].tolist() for column in columns), strict=True))


def node_values(store, signal):
    """Evaluate every node on single values, by the meaning of its operation."""
    called = {row_address(entry): entry for entry in PRIMITIVES.values()}
    found = []
    for operation, first, second, address, number in taken(store):
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


@given(several, signals())
def test_the_factors_of_a_term_multiply_to_the_value_of_the_expression(terms, signal):
    try:
        expected = [value(item.expression, signal) for item in terms]
    except ValueError:  # The sine of an infinite number.
        assume(False)
    store = TermPool()
    numbers = store.terms(terms)
    nodes = node_values(store, signal)
    for number, wanted in zip(numbers, expected, strict=True):
        degree = store.nodes.degree[number]
        assert 1 <= degree <= MAX_FACTORS
        found = math.prod(nodes[factor] for factor in store.nodes.factors[number, :degree])
        np.testing.assert_array_equal(found, wanted)


@given(several)
def test_equal_expressions_are_one_node_and_operands_stand_before_what_reads_them(terms):
    store = TermPool()
    store.terms(terms)
    nodes = taken(store)
    assert len(set(nodes)) == len(nodes)
    for number, (operation, first, second, *_) in enumerate(nodes):
        if operation >= 0:
            assert max(first, second) < number


@given(several, several)
def test_what_is_known_keeps_its_number_and_adds_no_node(terms, others):
    store = TermPool()
    numbers = store.terms(terms).tolist()
    store.terms(others)
    size, nodes = len(store), len(taken(store))
    assert store.terms(terms).tolist() == numbers
    assert (len(store), len(taken(store))) == (size, nodes)
    texts = [item.text for item in terms]
    assert len(set(numbers)) == len(set(texts))
    assert size == len({item.text for item in (*terms, *others)})


@given(several, several)
def test_a_program_does_not_depend_on_what_else_the_store_knows(terms, others):
    """Whatever came before: the nodes have other numbers, the program is the same."""
    store = TermPool()
    store.terms(others)
    numbers = store.terms(terms)
    operand_index = np.full(store.nodes.operation.size, -1, np.int64)
    for found, expected in zip(
        codegen.generate_program(store.nodes, numbers, operand_index), link(terms), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    assert (operand_index == -1).all()


def test_a_store_grows_and_keeps_what_it_knows():
    store = TermPool()
    texts = [f"exp({factor}*u(k-{lag})) + y(k-1)" for factor in range(2, 30) for lag in range(1, 40)]
    numbers = store.terms([made(text) for text in texts]).tolist()
    assert numbers == list(range(len(texts)))
    assert len(store) == len(texts) > 1024
    assert len(taken(store)) > 4 * 256
    values = node_values(store, lambda channel, lag: 1.0 / lag if channel else 2.0)
    for number, text in ((0, texts[0]), (500, texts[500]), (len(texts) - 1, texts[-1])):
        expected = value(made(text).expression, lambda channel, lag: 1.0 / lag if channel else 2.0)
        assert values[store.nodes.factors[number, 0]] == expected


def test_a_deep_expression_and_many_nodes_are_linked():
    """Deeper than the linker's stack is at first, and of more nodes than it has room for at first."""
    text = "u(k-1)"
    for lag in range(1, 60):
        text = f"tanh({text} - y(k-{lag}))"
    assert len(link([made(text)]).code) == 2 * 59
    wide = link([made(" + ".join(f"abs(u(k-{lag}) - 1)" for lag in range(1, 200)))])
    assert len(wide.code) == 199 + 199 + 198


def test_a_number_of_the_store_is_found_for_an_expression_as_for_its_regressor():
    store, item = TermPool(), made("y(k-1)*exp(u(k-1))")
    assert store.term(item) == store.term(item.expression) == 0
    assert store.term(Lagged(0, 0)) == 1
    assert store.term(Constant(2.5)) == 2
    assert store.terms([]).shape == (0,)


def test_two_functions_of_one_name_in_two_stores_are_called_each_at_its_own_address():
    one, other = primitive("own", lambda a: a + 1.0), primitive("own", lambda a: a + 2.0)
    found = [
        link([made("own(u(k-1))", {**PRIMITIVES, "own": entry})]).addresses.tolist() for entry in (one, other)
    ]
    assert found == [[row_address(one)], [row_address(other)]]
    assert found[0] != found[1]
