"""Text and tree of an equation convert to each other, and the text has the value of mathematics."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.expressions.primitives import EQUATION_FUNCTIONS
from islands.expressions.printing import render
from islands.expressions.tree import Apply, Constant, Symbol

#: Trees as the parser makes them: a negative number is one number.
LEAVES = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(Constant), st.sampled_from("xyz").map(Symbol)
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.sampled_from(sorted(EQUATION_FUNCTIONS)).flatmap(
        lambda name: st.tuples(
            *[inner.filter(lambda each: name != "neg" or not isinstance(each, Constant))]
            * EQUATION_FUNCTIONS[name].arity
        ).map(lambda arguments: Apply(EQUATION_FUNCTIONS[name], arguments))
    ),
    max_leaves=12,
)


@given(TREES)
def test_parsing_inverts_rendering(tree) -> None:
    assert parse_expression(render(tree)) == tree


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-x**2", -4.0),
        ("(-x)**2", 4.0),
        ("2**-x", 0.25),
        ("x - (y - 1)", 0.0),
        ("x/y/2", 1 / 3),
        ("-x*y + 2**3**1", 2.0),
        ("where(x > y, 1, -1)", -1.0),
        ("where(x <= 2, 1, -1)", 1.0),
        ("(x < y)*5 + (x >= y)", 5.0),
        ("min(x, y, -1) + max(x, y, 7)", 6.0),
        ("sign(-x) + abs(-y) + sqrt(x*2)", 4.0),
        ("tanh(0) + sin(pi/2) + exp(log(x))", 3.0),
    ],
)
def test_expressions_have_the_value_of_mathematics(text: str, value: float) -> None:
    tree = parse_expression(text)
    assert evaluate(tree, {"x": 2.0, "y": 3.0}) == pytest.approx(value)
    assert evaluate(parse_expression(render(tree)), {"x": 2.0, "y": 3.0}) == pytest.approx(value)
