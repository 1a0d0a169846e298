"""Expressions: height, lags and canonical order."""

import pytest

from islands.expressions.parsing import parse, parse_expression
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SUB
from islands.expressions.tree import (
    Apply,
    Constant,
    Lagged,
    Shift,
    Symbol,
    children,
    content,
    height,
    lags,
    remove_shifts,
    replace,
    replace_leaves,
    substitute,
    walk,
)
from islands.models.regressor import regressor

# Model (13) of the paper, section 7, as genes: q1 .. q5, products of two, phi1 and phi2.
MODEL_13 = (
    ("y(k-1)", "y(k-1)"),
    (
        "mul(mul(u(k-1), phi2(q3(u(k-1)), u(k-1))), phi1(q5(q5(q1(u(k-1)))), u(k-1)))",
        "u(k-1)*phi1(u(k-12), u(k-1))*phi2(u(k-4), u(k-1))",
    ),
    ("phi1(q5(q3(u(k-1))), q5(q5(q2(u(k-1)))))", "phi1(u(k-9), u(k-13))"),
    (
        "mul(mul(q1(y(k-1)), phi2(q5(u(k-1)), u(k-1))), phi1(q5(q5(q1(u(k-1)))), q5(q4(u(k-1)))))",
        "y(k-2)*phi1(u(k-12), u(k-10))*phi2(u(k-6), u(k-1))",
    ),
    ("mul(q5(q2(mul(y(k-1), u(k-1)))), phi1(u(k-1), q3(u(k-1))))", "y(k-8)*u(k-8)*phi1(u(k-1), u(k-4))"),
    ("phi1(q5(q4(u(k-1))), q5(u(k-1)))", "phi1(u(k-10), u(k-6))"),
    ("phi1(u(k-1), q5(q5(q2(u(k-1)))))", "phi1(u(k-1), u(k-13))"),
    ("phi2(q5(q5(q4(u(k-1)))), q5(q5(q1(u(k-1)))))", "phi2(u(k-15), u(k-12))"),
    ("mul(mul(u(k-1), q5(q5(q1(u(k-1))))), phi1(q1(u(k-1)), u(k-1)))", "u(k-1)*u(k-12)*phi1(u(k-2), u(k-1))"),
)


@pytest.mark.parametrize(("gene", "term"), MODEL_13)
def test_model_13_can_be_written_with_the_papers_back_shifts(gene, term):
    assert regressor(parse(gene)) == regressor(parse(term))


def test_model_13_fits_a_height_of_five_exactly():
    heights = [height(parse(gene)) for gene, _ in MODEL_13]
    assert heights == [0, 5, 4, 5, 4, 3, 4, 4, 5]


def test_phi2_has_a_smaller_height_than_the_sign_of_a_difference():
    assert height(parse("phi2(q5(u(k-1)), u(k-1))")) == 2
    assert height(parse("sign(q5(u(k-1)) - u(k-1))")) == 3


@pytest.mark.parametrize(
    ("text", "edges"),
    [("u(k-9)", 0), ("3", 0), ("q5(u(k-1))", 1), ("u(k-1)*u(k-2)*y(k-1)", 1), ("exp(2*y(k-1))", 2)],
)
def test_height_counts_edges_from_the_root_to_the_deepest_leaf(text, edges):
    assert height(parse(text)) == edges


def test_back_shifts_add_to_the_lags_of_all_leaves_below():
    expression = Shift(2, Apply(MUL, (Lagged(0, 1), Shift(3, Lagged(2, 4)), Constant(7.0))))
    assert remove_shifts(expression) == Apply(MUL, (Lagged(0, 3), Lagged(2, 9), Constant(7.0)))
    assert lags(expression) == {(0, 3), (2, 9)}


def test_walk_yields_nodes_in_pre_order():
    left, right = Apply(SUB, (Lagged(1), Lagged(2))), Shift(1, Constant(3.0))
    expression = Apply(ADD, (left, right))
    assert children(expression) == (left, right)
    assert list(walk(expression)) == [
        expression,
        left,
        Lagged(1),
        Lagged(2),
        right,
        Constant(3.0),
    ]


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


def test_functions_of_equations_are_not_protected_but_share_the_arithmetic():
    assert Apply(PRIMITIVES["div"], (Symbol("a"), Symbol("b"))) != parse_expression("a/b")
    assert Apply(MUL, (Symbol("a"), Symbol("b"))) == parse_expression("a*b")


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
