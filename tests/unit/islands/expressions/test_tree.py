"""Expressions: height, lags and canonical order."""

import pytest

from islands.expressions.parsing import parse, parse_expression
from islands.expressions.primitives import ADD, MUL, PRIMITIVES
from islands.expressions.tree import (
    Apply,
    Constant,
    Lagged,
    Shift,
    Symbol,
    content,
    height,
    replace,
    replace_leaves,
    substitute,
)


@pytest.mark.parametrize(
    ("text", "edges"),
    [("u(k-9)", 0), ("3", 0), ("q5(u(k-1))", 1), ("u(k-1)*u(k-2)*y(k-1)", 1), ("exp(2*y(k-1))", 2)],
)
def test_height_counts_edges_from_the_root_to_the_deepest_leaf(text, edges):
    assert height(parse(text)) == edges


def test_content_orders_signals_functions_back_shifts_numbers():
    rising = [
        Lagged(0, 1),
        Lagged(0, 10),
        Lagged(1, 2),
        Apply(MUL, (Lagged(0, 9), Lagged(1, 1))),
        Apply(MUL, (Lagged(1, 1), Lagged(0, 9))),
        Apply(MUL, (Lagged(0, 1),) * 3),
        Apply(PRIMITIVES["sin"], (Lagged(0, 1),)),
        Shift(1, Lagged(0, 1)),
        Shift(2, Lagged(0, 1)),
        Constant(-2.0),
        Constant(3.0),
    ]
    keys = [content(expression) for expression in rising]
    assert keys == sorted(keys)
    assert len(set(keys)) == len(keys)


def test_parts_of_an_expression_are_replaced_from_the_root_down():
    expression = Shift(1, Apply(ADD, (Apply(MUL, (Lagged(1), Lagged(2))), Lagged(1))))
    found = replace(
        expression, lambda part: Lagged(3) if part == Apply(MUL, (Lagged(1), Lagged(2))) else None
    )
    assert found == Shift(1, Apply(ADD, (Lagged(3), Lagged(1))))
    assert replace_leaves(expression, lambda leaf: Lagged(0, leaf.lag)) == Shift(
        1, Apply(ADD, (Apply(MUL, (Lagged(0), Lagged(0))), Lagged(0)))
    )
    assert substitute(parse_expression("x*rate(x)"), {"x": Symbol("F")}) == parse_expression("F*rate(F)")
