"""Text of expressions and equations, case by case; what cannot be read says why."""

from itertools import pairwise
from xml.etree import ElementTree

import pytest
from hypothesis import given

from islands.errors import ModelError
from islands.model.equations import equation, latex_equation, mathml_equation
from islands.model.expression import Apply, Constant, Lagged, Primitive, Shift
from islands.model.model import model_of
from islands.model.parsing import parse
from islands.model.primitives import ADD, MUL, PRIMITIVES, SUB
from islands.model.text import LARGEST_POWER, at_rest, latex, mathml, plain
from support.strategies import models, regressors

U, Y = Lagged(1, 1), Lagged(0, 1)


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
def test_plain_text_of(expression, text):
    assert plain(expression) == text
    assert parse(text) == expression


@pytest.mark.parametrize(
    ("text", "expression"),
    [
        ("  u(k - 1) ", U),
        ("u1(k-1)", U),
        ("u(k-1)**2", mul(U, U)),
        ("u(k-1)^1", U),
        ("u(k-1)^1*y(k-1)^2", mul(U, Y, Y)),
        ("u(k-1) - y(k-1) - u(k-1)", sub(sub(U, Y), U)),
        ("u(k-1)*y(k-1)/u(k-1)", div(mul(U, Y), U)),
        ("u(k-1)/y(k-1)*u(k-1)", mul(div(U, Y), U)),
        ("-u(k-1)*y(k-1)", mul(mul(Constant(-1.0), U), Y)),
        ("-3", Constant(-3.0)),
        ("-2^2", mul(Constant(-1.0), mul(Constant(2.0), Constant(2.0)))),
        ("mul(u(k-1), y(k-1), 2)", mul(U, Y, Constant(2.0))),
        ("q12(y(k))", Shift(12, Lagged(0, 0))),
    ],
)
def test_text_that_is_read(text, expression):
    assert parse(text) == expression


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"cannot read '': write it like u\(k-1\)\*sign\(u\(k-1\) - u\(k-2\)\)"),
        ("u(k-1", r"cannot read 'u\(k-1': write it like"),
        ("u(k-1) y(k-1)", "write it like"),
        ("\0", "write it like"),
        ("u", "cannot read 'u': a leaf is y"),
        ("'u'", "a leaf is y"),
        ("True", "cannot read 'True': a leaf is y"),
        ("-True", "cannot read 'True'"),
        ("1e999", "a leaf is y"),
        ("1" + "0" * 400, "a leaf is y"),
        ("2j", "cannot read '2j'"),
        ("u(k-1) if 1 else 2", "cannot read 'u.k - 1. if 1 else 2'"),
        ("max(*u(k-1))", "max takes 2 arguments, got 1"),
        ("max(a=1)", r"cannot read 'max\(a=1\)'"),
        ("u(k-1) % 2", "cannot read"),
        ("(1).real(2)", "cannot read"),
        ("gauss(u(k-1))", "unknown function 'gauss': known are mul, sub, sign, phi1, phi2, add"),
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
        ("u(k-1)^0", r"cannot read 'u\(k - 1\) \*\* 0': a power is a whole number from 1 to 99"),
        ("u(k-1)^100", "a power is a whole number from 1 to 99"),
        ("u(k-1)^2.5", "a power is a whole number"),
        ("u(k-1)^-1", "a power is a whole number"),
        ("u(k-1)^True", "a power is a whole number"),
        ("2^2^2", "a power is a whole number"),
        ("-" * 5000 + "1", "cannot read '-{80}': write it like"),
        ("+".join(["u(k-1)"] * 5000), "write it like"),
    ],
)
def test_text_that_cannot_be_read_says_which_part_and_what_to_write(text, message):
    with pytest.raises(ModelError, match=message):
        parse(text)


def test_the_largest_power_is_read():
    assert len(parse(f"u(k-1)^{LARGEST_POWER}").arguments) == LARGEST_POWER


def test_a_table_without_a_function_does_not_read_it():
    table = {name: PRIMITIVES[name] for name in ("mul", "sub")}
    with pytest.raises(ModelError, match=r"unknown function 'tanh': known are mul, sub$"):
        parse("tanh(u(k-1))", table)


@pytest.mark.parametrize(
    ("expression", "inputs", "text"),
    [
        (mul(Lagged(0, 0), Lagged(1, 0)), 1, "y*u"),
        (mul(Lagged(0, 0), Lagged(2, 0)), 2, "y*u2"),
        (Constant(1.0), 1, "1"),
    ],
)
def test_a_steady_state_is_written_without_time(expression, inputs, text):
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
        ("(u(k-1)/y(k-1))^2", r"\left(\frac{u_{k-1}}{y_{k-1}}\right)^{2}"),
        ("1e-5^2", r"\left(1 \times 10^{-5}\right)^{2}"),
        ("sqrt(y(k-1) + 2*u(k-1))", r"\sqrt{\left|y_{k-1} + 2 u_{k-1}\right|}"),
        ("q2(u(k-1)*y(k-1))", r"q^{-2} \left(u_{k-1} y_{k-1}\right)"),
        ("u(k-1)*q1(y(k-1))", r"u_{k-1} \left(q^{-1} y_{k-1}\right)"),
        ("max(u(k-1), exp(y(k-1)))", r"\max(u_{k-1}, \exp(y_{k-1}))"),
        ("u(k-1) - (y(k-1) - 1)", r"u_{k-1} - \left(y_{k-1} - 1\right)"),
    ],
)
def test_latex_of(text, written):
    assert latex(parse(text)) == written


def test_latex_does_not_split_a_large_power():
    assert latex(mul(*[U] * 243)) == "u_{k-1}^{243}"


MODEL_12 = model_of(
    [
        (parse("y(k-1)"), 1.0),
        (parse("phi1(u(k-1), u(k-2))"), 0.77),
        (parse("u(k-2)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))"), 1.44e-2),
        (parse("y(k-1)*phi2(u(k-2), u(k-3))*phi1(u(k-2), u(k-3))"), -9.6e-3),
        (parse("u(k-2)^2*phi1(u(k-2), u(k-3))"), 3.15e-4),
        (parse("u(k-2)*y(k-1)*phi1(u(k-2), u(k-3))"), -2.46e-4),
    ]
)


def test_the_equation_of_the_papers_model_12():
    assert equation(MODEL_12) == (
        "y(k) = 1*y(k-1) - 0.000246*y(k-1)*u(k-2)*(u(k-2) - u(k-3))"
        " - 0.0096*y(k-1)*sign(u(k-2) - u(k-3))*(u(k-2) - u(k-3))"
        " + 0.000315*u(k-2)^2*(u(k-2) - u(k-3))"
        " + 0.0144*u(k-2)*sign(u(k-2) - u(k-3))*(u(k-2) - u(k-3)) + 0.77*(u(k-1) - u(k-2))"
    )


def test_the_latex_of_the_papers_model_12_rounds_to_the_digits_asked_for():
    assert latex_equation(MODEL_12, digits=1).startswith(
        r"y_{k} = 1 \, y_{k-1} - 0.0002 \, y_{k-1} u_{k-2} \left(u_{k-2} - u_{k-3}\right)"
        r" - 0.01 \, y_{k-1} \operatorname{sign}(u_{k-2} - u_{k-3}) \left(u_{k-2} - u_{k-3}\right)"
    )


def test_an_equation_without_parameters_numbers_them():
    bare = model_of(
        [(parse("y(k-1)"), 1.0), (parse("u1(k-1) + u2(k-1)"), 1.0), (parse("1"), 1.0)], ("u1", "u2")
    )
    bare = type(bare)(bare.regressors, input_names=bare.input_names)
    assert equation(bare) == "y(k) = theta1*y(k-1) + theta2*(u1(k-1) + u2(k-1)) + theta3"
    assert latex_equation(bare) == (
        r"y_{k} = \theta_{1} \, y_{k-1} + \theta_{2} \, \left(u_{1,k-1} + u_{2,k-1}\right) + \theta_{3}"
    )


def test_an_equation_shows_very_small_and_negative_parameters():
    model = model_of([(parse("y(k-1)"), -1.5e-7), (parse("u(k-1)"), -2.0), (parse("1"), -0.25)])
    assert equation(model) == "y(k) = -1.5e-07*y(k-1) - 2*u(k-1) - 0.25"
    assert latex_equation(model) == r"y_{k} = -1.5 \times 10^{-7} \, y_{k-1} - 2 \, u_{k-1} - 0.25"


def test_a_quotient_keeps_its_brackets_behind_its_parameter():
    # 0.5*u/y would be read as (0.5*u)/y, another regressor: division is protected.
    assert equation(model_of([(parse("u(k-1)/y(k-1)"), 0.5)])) == "y(k) = 0.5*(u(k-1)/y(k-1))"


@given(models(inputs=2))
def test_the_inputs_of_an_equation_are_numbered_where_there_are_several(model):
    assert "u(" not in equation(model)
    written = latex_equation(model)
    assert written.count("{") == written.count("}")
    assert written.count(r"\left") == written.count(r"\right")


# MathML: a reader of the browser's page sees what stands in plain text.

_SEEN = {
    "\u2212": " - ",
    "+": " + ",
    "=": " = ",
    "\u2062": "*",
    "\u2061": "",
    "\u00d7": "e",
    "\u03b8": "theta",
}


def seen(element):
    """Plain text of what is visible: an ``mrow`` keeps nothing together, brackets alone do."""
    parts = [seen(child) for child in element]
    match element.tag, parts:
        case (("mi" | "mn" | "mo"), []):
            return _SEEN.get(element.text, element.text)
        case "msub", ["theta", index]:
            return f"theta{index}"
        case "msub", [name, index]:
            channel, _, time = index.rpartition(",")
            return f"{name}{channel}({time.replace(' ', '')})"
        case "msup", ["10", exponent]:
            # Of a number: a power of the constant 10 has brackets.
            return exponent.replace(" ", "")
        case "msup", ["q", exponent]:
            return f"q{exponent.removeprefix(' - ')}"
        case "msup", [base, exponent]:
            return f"{base}^{exponent}"
        case "mfrac", [first, second]:
            return f"div({first}, {second})"
        case "msqrt", [inside]:
            return inside.replace("abs", "sqrt", 1)
        case "mrow", ["|", inside, "|"]:
            return f"abs({inside})"
        case "mrow", ["ln", "", inside]:
            return inside.replace("abs", "log", 1)
        case (("math" | "mrow" | "mtable" | "mtr" | "mtd"), _):
            return "".join(parts)
    raise AssertionError(ElementTree.tostring(element))


def seen_in(text):
    return seen(ElementTree.fromstring(text))


@pytest.mark.parametrize(
    ("text", "what_is_seen"),
    [
        ("y(k-12)", "y(k-12)"),
        ("u(k)", "u(k)"),
        ("-2*u(k-1)", "( - 2)*u(k-1)"),
        ("1e-5 + y(k-1)", "1e-5 + y(k-1)"),
        ("1e-5*u(k-1)", "1e-5*u(k-1)"),
        ("-1.5e200*u(k-1)", "( - 1.5e200)*u(k-1)"),
        ("u(k-1)*2*3*(-4)", "u(k-1)*(2)*(3)*( - 4)"),
        ("2^2*(1e-5)^2*(-3)^2", "(2)^2*(1e-5)^2*( - 3)^2"),
        ("10^2*u(k-1)", "(10)^2*u(k-1)"),
        ("u(k-1)^3*(y(k-1) - 1)^2", "u(k-1)^3*(y(k-1) - 1)^2"),
        ("(u(k-1)*y(k-1) + 1)^2", "(u(k-1)*y(k-1) + 1)^2"),
        ("sign(u(k-1))^2*abs(u(k-1))^2", "sign(u(k-1))^2*abs(u(k-1))^2"),
        ("(u(k-1)/y(k-1))^2*(u(k-1)/y(k-2))", "(div(u(k-1), y(k-1)))^2*div(u(k-1), y(k-2))"),
        ("sqrt(y(k-1) + 2*u(k-1))^2*sqrt(u(k-1))", "(sqrt(y(k-1) + 2*u(k-1)))^2*sqrt(u(k-1))"),
        ("log(y(k-1))^2*log(u(k-1) - 1)", "(log(y(k-1)))^2*log(u(k-1) - 1)"),
        ("max(u(k-1), exp(y(k-1)))", "max(u(k-1),exp(y(k-1)))"),
        ("u(k-1) - (y(k-1) - 1)", "u(k-1) - (y(k-1) - 1)"),
        ("u(k-1) + (-1)", "u(k-1) + ( - 1)"),
        ("phi2(u(k-1), u(k-2))", "phi2(u(k-1),u(k-2))"),
        ("q2(u(k-1)*y(k-1))", "q2*(u(k-1)*y(k-1))"),
        ("u(k-1)*q1(y(k-1))", "u(k-1)*(q1*y(k-1))"),
    ],
)
def test_what_is_seen_of_an_expression_in_mathml(text, what_is_seen):
    assert seen_in(mathml(parse(text))) == what_is_seen


def test_a_leaf_in_mathml():
    assert mathml(Lagged(2, 3), 2) == (
        "<msub><mi>u</mi><mrow><mn>2</mn><mo>,</mo><mi>k</mi><mo>&#x2212;</mo><mn>3</mn></mrow></msub>"
    )


def test_a_fraction_and_a_root_in_mathml():
    past = "<mrow><mi>k</mi><mo>&#x2212;</mo><mn>1</mn></mrow>"
    u, y = (f"<msub><mi>{name}</mi>{past}</msub>" for name in "uy")
    assert mathml(parse("u(k-1)/y(k-1)")) == f"<mfrac>{u}{y}</mfrac>"
    assert mathml(parse("sqrt(u(k-1))")) == f"<msqrt><mrow><mo>|</mo>{u}<mo>|</mo></mrow></msqrt>"


def test_the_name_of_a_function_cannot_break_mathml():
    for name, written in (("a<b&c>", "a&lt;b&amp;c&gt;"), ("\u03c3", "&#963;"), ("{0}", "{0}")):
        text = mathml(Apply(Primitive(name, 1, abs, "{0}"), (U,)))
        assert f"<mi>{written}</mi>" in text
        assert seen_in(text) == f"{name}(u(k-1))"


@given(models(inputs=2))
def test_mathml_of_every_model_shows_its_plain_equation(model):
    written = mathml_equation(model)
    left, _, shown = seen_in(written).partition(" = ")
    assert left == "y(k)"
    # Text is parsed, because a number and a product are written in more than one way.
    assert parse(shown) == parse(equation(model).removeprefix("y(k) = "))


@given(models(inputs=1, most=12))
def test_mathml_of_every_model_is_a_block_of_ascii_with_a_sign_between_two_terms(model):
    written = mathml_equation(model)
    assert written.isascii()
    assert written.startswith('<math display="block">')
    assert written.count('form="infix"') == model.size - 1
    assert "u1" not in seen_in(written)


@given(models(inputs=2, most=12))
def test_a_row_of_mathml_is_short_or_a_single_term(model):
    rows = ElementTree.fromstring(mathml_equation(model)).findall(".//mtr")
    for row in rows:
        text = "".join(row[1].itertext())
        signs = [mark for mark in row[1].iter("mo") if mark.get("form") == "infix"]
        assert len(text) <= 80 or len(signs) <= 1
    # Another row begins only where the term did not fit.
    for row, following in pairwise(rows):
        assert "form" in following[1][0].attrib
        assert len("".join((*row[1].itertext(), *following[1].itertext()))) > 80


def test_a_short_equation_is_no_table():
    written = mathml_equation(
        model_of([(parse("y(k-1)"), -1.5e-7), (parse("u(k-1)"), -2.0), (parse("1"), -0.25)])
    )
    assert "mtable" not in written
    assert seen_in(written) == "y(k) =  - 1.5e-7*y(k-1) - 2*u(k-1) - 0.25"


def test_the_mathml_of_the_papers_model_12_has_two_rows_and_the_digits_asked_for():
    root = ElementTree.fromstring(mathml_equation(MODEL_12, digits=1))
    first, second = (seen(row) for row in root.findall(".//mtr"))
    assert first == (
        "y(k) = 1*y(k-1) - 0.0002*y(k-1)*u(k-2)*(u(k-2) - u(k-3))"
        " - 0.01*y(k-1)*sign(u(k-2) - u(k-3))*(u(k-2) - u(k-3))"
    )
    assert second == (
        " + 0.0003*u(k-2)^2*(u(k-2) - u(k-3))"
        " + 0.01*u(k-2)*sign(u(k-2) - u(k-3))*(u(k-2) - u(k-3)) + 0.8*(u(k-1) - u(k-2))"
    )


def test_mathml_without_parameters_numbers_them():
    named = model_of(
        [(parse("y(k-1)"), 1.0), (parse("u1(k-1) + u2(k-1)"), 1.0), (parse("1"), 1.0)], ("a", "b")
    )
    bare = type(named)(named.regressors, input_names=named.input_names)
    assert seen_in(mathml_equation(bare)) == "y(k) = theta1*y(k-1) + theta2*(u1(k-1) + u2(k-1)) + theta3"


@given(regressors(inputs=2))
def test_mathml_of_every_regressor_is_one_element(item):
    assert ElementTree.fromstring(mathml(item.expression, 2)).tag in {"mrow", "msub", "mn", "mfrac", "msqrt"}
