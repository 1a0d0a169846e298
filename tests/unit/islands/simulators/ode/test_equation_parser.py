"""Equations: mistakes have clear messages, comments and empty lines are ignored."""

import pytest

from islands.errors import ModelError
from islands.simulators.ode.equation_parser import parse_equations


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
