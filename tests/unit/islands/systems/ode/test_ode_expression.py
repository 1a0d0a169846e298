"""Expressions: text and tree convert to each other, and mistakes in equations have clear messages."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import ModelError
from islands.systems.ode.equation_parser import parse_equations, parse_expression
from islands.systems.ode.ode_expression import (
    FUNCTIONS,
    Number,
    Operation,
    Symbol,
    evaluate,
    find_symbols,
    render,
)

#: Trees as the parser makes them: a negative number is one number.
LEAVES = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(Number), st.sampled_from("xyz").map(Symbol)
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.sampled_from(sorted(FUNCTIONS)).flatmap(
        lambda name: st.tuples(
            *[inner.filter(lambda each: name != "neg" or not isinstance(each, Number))]
            * FUNCTIONS[name].arity
        ).map(lambda arguments: Operation(name, arguments))
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


def test_evaluation_accepts_arrays_and_values_of_rates() -> None:
    tree = parse_expression("where(x > 0, x, rate(F))")
    found = evaluate(tree, {"x": np.array([-1.0, 2.0]), "rate(F)": 5.0})
    assert found.tolist() == [5.0, 2.0]
    assert set(find_symbols(tree)) == {"x", "F"}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("dx/dt = (v", "line 2 of the equations, .*this is not an expression"),
        ("dx/dt v", "write dNAME/dt = ... for a state"),
        ("d(x)/dt = v", "the left side is dNAME/dt"),
        ("x'' = v", "the left side is dNAME/dt"),
        ("dx/dt = v^2", r"write a power as x\*\*2"),
        ("dx/dt = heaviside(v)", "unknown function 'heaviside': take one of abs, sqrt"),
        ("dx/dt = add(v, v)", "unknown function 'add'"),
        ("dx/dt = sqrt(v, 2)", "sqrt takes 1 arguments, got 2"),
        ("dx/dt = v if v else 0", "cannot read"),
        ("dx/dt = v.real", "cannot read 'v.real'"),
        ("dx/dt = v[0]", "cannot read"),
        ("dx/dt = __import__('os')", "cannot read \"'os'\""),
        ("dx/dt = 0 < v < 1", "one comparison"),
        ("dx/dt = v == 1", "one comparison"),
        ("dx/dt = True", "cannot read 'True'"),
        ("dx/dt = -True", "cannot read 'True'"),
        ("dx/dt = 1e999", "a number is too large"),
        ("dx/dt = " + "(" * 250 + "v" + ")" * 250, "not an expression|too deeply"),
        ("dx/dt = " + "+".join(["v"] * 300), "nested too deeply"),
        ("dx/dt = rate(v + 1)", "write rate"),
        ("dx/dt = delay(F, 2*tau)", "tau is a parameter or a number"),
        ("lambda = 1", "no word of Python"),
        ("sin = 1", "'sin' already has a meaning"),
        ("t = 1", "'t' already has a meaning"),
        ("dω/dt = 1", "the left side is dNAME/dt"),
        ("ω = 1", "is not a name"),
    ],
)
def test_a_mistake_is_reported_with_its_line(line: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        parse_equations(f"# first\n{line}\n")


def test_comments_and_empty_lines_are_ignored() -> None:
    first, second = parse_equations("\n# all\nd x / dt = v # rate\n\n v = 2 * x\n")
    assert (first.target, first.is_derivative, second.target, second.is_derivative) == ("x", True, "v", False)
