"""Equations for readers, as text and as MathML."""

from xml.etree import ElementTree

import pytest

from islands.errors import ModelError
from islands.expressions.equation_printing import EquationMathmlPrinter, EquationTextPrinter
from islands.expressions.parsing import parse_expression, parse_formula


@pytest.mark.parametrize(
    "text",
    [
        "(u(t - tau) - c*v - k*x - F*sign(v))/m",
        "clip(x, -L, L) + k*(a - (b - c))",
        "(2*pi/P)**2*(x - y) - 4*pi*zeta/P*w",
        "-x**2 + (-x)**2 < 2",
        "G[play(u, b)] - F*sign(rate(u))",
    ],
)
def test_the_text_of_an_equation_is_what_was_read(text: str) -> None:
    read = parse_formula(text.replace("[", "(").replace("]", ")"))
    assert EquationTextPrinter().write(read) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("(u - c*v)/m_1", ["mfrac", "msub"]),
        ("abs(x)**3", ["msup"]),
        ("sqrt(max(upper, 0))", ["msqrt"]),
        ("a <= b*(x - (y + z))", []),
        ("exp(-t/tau)", ["msup", "mfrac"]),
    ],
)
def test_mathml_is_one_element_with_the_structure_of_the_expression(text: str, shown: list[str]) -> None:
    written = EquationMathmlPrinter().write(parse_expression(text))
    assert written.isascii()
    tags = [each.tag for each in ElementTree.fromstring(f"<math>{written}</math>").iter()]
    assert len(ElementTree.fromstring(f"<math>{written}</math>")) == 1
    assert all(tag in tags for tag in shown)


def test_a_name_from_a_user_is_escaped() -> None:
    assert EquationMathmlPrinter().symbol("a<b") == "<mi>a&lt;b</mi>"


def test_a_formula_that_is_no_expression_is_an_error() -> None:
    with pytest.raises(ModelError, match="not an expression"):
        parse_formula("clip(x,")
