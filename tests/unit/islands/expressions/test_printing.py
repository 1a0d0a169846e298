"""Rendering and parsing of expressions."""

from xml.etree import ElementTree

import pytest

from islands.errors import ModelError
from islands.expressions.parsing import parse, parse_expression, parse_formula
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SUB
from islands.expressions.printing import (
    EquationMathmlPrinter,
    EquationTextPrinter,
    at_rest,
    latex,
    plain,
)
from islands.expressions.tree import Apply, Constant, Lagged, Shift

U = Lagged(1, 1)
Y = Lagged(0, 1)


def mul(*factors):
    return Apply(MUL, factors)


def add(*terms):
    return Apply(ADD, terms)


def sub(first, second):
    return Apply(SUB, (first, second))


def div(first, second):
    return Apply(PRIMITIVES["div"], (first, second))


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (Lagged(2, 12), "u2(k-12)"),
        (Lagged(1, 0), "u(k)"),
        (Constant(-2.0), "-2"),
        (Constant(1e-5), "1e-05"),
        (mul(U, U, U, Y), "u(k-1)^3*y(k-1)"),
        (mul(U, Y, U), "u(k-1)*y(k-1)*u(k-1)"),
        (mul(add(U, Y), add(U, Y)), "(u(k-1) + y(k-1))^2"),
        (mul(mul(U, Y), mul(U, Y)), "mul(u(k-1), y(k-1))^2"),
        (mul(U, mul(U, Y)), "u(k-1)*mul(u(k-1), y(k-1))"),
        (mul(Constant(-2.0), U), "(-2)*u(k-1)"),
        (mul(Constant(-0.0), Constant(-0.0)), "(-0)^2"),
        (mul(div(U, Y), U), "(u(k-1)/y(k-1))*u(k-1)"),
        (mul(div(U, Y), div(U, Y)), "(u(k-1)/y(k-1))^2"),
        (div(mul(U, Y), div(U, Y)), "(u(k-1)*y(k-1))/(u(k-1)/y(k-1))"),
        (add(U, Y, Constant(-1.0)), "u(k-1) + y(k-1) + (-1)"),
        (add(U, sub(U, Y)), "u(k-1) + sub(u(k-1), y(k-1))"),
        (sub(add(U, Y), sub(U, Y)), "add(u(k-1), y(k-1)) - sub(u(k-1), y(k-1))"),
        (sub(mul(U, Y), div(U, Y)), "u(k-1)*y(k-1) - u(k-1)/y(k-1)"),
        (Shift(5, Shift(5, U)), "q5(q5(u(k-1)))"),
        (Apply(PRIMITIVES["phi2"], (Lagged(1, 4), U)), "phi2(u(k-4), u(k-1))"),
        (mul(*[U] * 243), "u(k-1)^99*u(k-1)^99*u(k-1)^45"),
        (mul(*[U] * 100), "u(k-1)^99*u(k-1)"),
    ],
)
def test_plain_text_of_an_expression_parses_back_to_it(expression, text):
    assert plain(expression) == text
    assert parse(text) == expression


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"cannot read '': write it like u\(k-1\)\*sign\(u\(k-1\) - u\(k-2\)\)"),
        ("u(k-1", r"cannot read 'u\(k-1': write it like"),
        ("u(k-1) y(k-1)", "write it like"),
        ("\0", "write it like"),
        ("u", "cannot read 'u': use leaves y"),
        ("'u'", "use leaves y"),
        ("True", "cannot read 'True': use leaves y"),
        ("-True", "cannot read 'True'"),
        ("1e999", "use leaves y"),
        ("1" + "0" * 400, "use leaves y"),
        ("2j", "cannot read '2j'"),
        ("u(k-1) if 1 else 2", "cannot read 'u.k - 1. if 1 else 2'"),
        ("max(*u(k-1))", "max takes 2 arguments, got 1"),
        ("max(a=1)", r"cannot read 'max\(a=1\)'"),
        ("u(k-1) % 2", "cannot read"),
        ("(1).real(2)", "cannot read"),
        ("gauss(u(k-1))", "unknown function 'gauss': take one of mul, sub, sign, phi1, phi2, add"),
        ("y1(k-1)", "unknown function 'y1'"),
        ("u0(k-1)", "unknown function 'u0'"),
        ("u01(k-1)", "unknown function 'u01'"),
        ("tanh(u(k-1), y(k-1))", "tanh takes 1 arguments, got 2"),
        ("sub(u(k-1), y(k-1), 1)", "sub takes 2 arguments, got 3"),
        ("mul(u(k-1))", "mul takes 2 arguments, got 1"),
        ("u(k+1)", r"cannot read the lag 'k \+ 1': write k-1, k-2, ..."),
        ("u(1)", "cannot read the lag '1'"),
        ("u(k-y(k-1))", "cannot read the lag"),
        ("u(k-1.5)", r"cannot read the lag 'k - 1\.5'"),
        ("u(k--1)", "cannot read the lag"),
        ("u(k-True)", "cannot read the lag 'k - True'"),
        ("u(k-1)^0", r"cannot read 'u\(k - 1\) \*\* 0': an exponent must be an integer from 1 to 99"),
        ("u(k-1)^100", "an exponent must be an integer from 1 to 99"),
        ("u(k-1)^2.5", "an exponent must be an integer"),
        ("u(k-1)^-1", "an exponent must be an integer"),
        ("u(k-1)^True", "an exponent must be an integer"),
        ("2^2^2", "an exponent must be an integer"),
        ("-" * 5000 + "1", "cannot read '-{80}': write it like"),
        ("+".join(["u(k-1)"] * 5000), "write it like"),
    ],
)
def test_parse_error_names_the_unreadable_part(text, message):
    with pytest.raises(ModelError, match=message):
        parse(text)


@pytest.mark.parametrize(
    ("expression", "inputs", "text"),
    [
        (mul(Lagged(0, 0), Lagged(1, 0)), 1, "y*u"),
        (mul(Lagged(0, 0), Lagged(2, 0)), 2, "y*u2"),
        (Constant(1.0), 1, "1"),
    ],
)
def test_steady_state_text_has_no_time_index(expression, inputs, text):
    assert at_rest(expression, inputs) == text


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("y(k-12)", "y_{k-12}"),
        ("u(k)", "u_{k}"),
        ("u2(k-3)", "u_{2,k-3}"),
        ("0.1*u(k-1)", "0.1 u_{k-1}"),
        ("-2*u(k-1)", r"\left(-2\right) u_{k-1}"),
        ("1e-5 + y(k-1)", r"1 \times 10^{-5} + y_{k-1}"),
        ("u(k-1)*2*3", r"u_{k-1} \left(2\right) \left(3\right)"),
        ("u(k-1)^3*(y(k-1) - 1)^2", r"u_{k-1}^{3} \left(y_{k-1} - 1\right)^{2}"),
        ("phi1(u(k-1), u(k-2))^2", r"\left(u_{k-1} - u_{k-2}\right)^{2}"),
        ("sign(u(k-1))^2", r"\operatorname{sign}(u_{k-1})^{2}"),
        ("abs(u(k-1))^2", r"\left|u_{k-1}\right|^{2}"),
        ("square(u(k-1))^2", r"\left(\left(u_{k-1}\right)^{2}\right)^{2}"),
        ("(u(k-1)/y(k-1))^2", r"\operatorname{div}(u_{k-1}, y_{k-1})^{2}"),
        ("1e-5^2", r"\left(1 \times 10^{-5}\right)^{2}"),
        ("sqrt(y(k-1) + 2*u(k-1))", r"\sqrt{\left|y_{k-1} + 2 u_{k-1}\right|}"),
        ("q2(u(k-1)*y(k-1))", r"q^{-2} \left(u_{k-1} y_{k-1}\right)"),
        ("u(k-1)*q1(y(k-1))", r"u_{k-1} \left(q^{-1} y_{k-1}\right)"),
        ("max(u(k-1), exp(y(k-1)))", r"\max(u_{k-1}, \exp(\min(y_{k-1}, 50)))"),
        ("u(k-1) - (y(k-1) - 1)", r"u_{k-1} - \left(y_{k-1} - 1\right)"),
    ],
)
def test_latex_of_an_expression(text, written):
    assert latex(parse(text)) == written


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
