"""Equations of models in plain text, LaTeX and MathML."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.printing import mathml
from islands.models.equations import (
    equation,
    latex_equation,
    mathml_equation,
    named_equation,
    named_statement,
    named_term,
)
from islands.models.narx import make_model
from support.strategies import models

#: Functions that a printed equation needs: `div` as docs/reference/expressions.md defines it, and NumPy's.
RUNTIME = {name: getattr(np, name) for name in ("sqrt", "log", "exp", "abs", "tanh", "sign")} | {
    "min": np.minimum,
    "max": np.maximum,
    "div": lambda a, b: a / b if b else 0.0,
}


@pytest.mark.parametrize(
    "text",
    [
        *("sqrt(u(k-1))", "log(u(k-1))", "exp(40*u(k-1))", "u(k-1)/y(k-1)", "sqrt(y(k-1) - u(k-1))*u(k-2)"),
        *("1/(u(k-1) - u(k-1))", "log(u(k-1)/y(k-1))^2", "u(k-1)/u(k-2)/y(k-1)", "u(k-1)/(u(k-2)*y(k-1))"),
        *("sqrt(log(u(k-1)))", "(u(k-1)/y(k-1))^2*sqrt(u(k-2))^3", "tanh(u(k-1)) - sqrt(-2)"),
    ],
)
def test_a_printed_equation_runs_and_has_the_value_of_the_model(text):
    """Copied from a summary, sqrt(u) and u/y gave NaN at negative and zero values."""
    model = make_model([(parse(text), 0.5), (parse("y(k-1)"), 0.25)], ("i_A",), "v_V")
    right = named_equation(model, digits=17).partition("=")[2].replace("^", "**")
    for signals in np.random.default_rng(1).uniform(-3.0, 3.0, (50, 2, 3)):

        def sample(name, lag, signals=signals):
            return signals[("v_V", "i_A").index(name)][lag]

        printed = re.sub(r"(v_V|i_A)\(k-(\d)\)", lambda found: f'sample("{found[1]}", {found[2]})', right)
        terms = zip(model.parameters, model.regressors, strict=True)
        expected = sum(
            weight * value(item.expression, lambda channel, lag, signals=signals: signals[channel][lag])
            for weight, item in terms
        )
        assert np.isfinite(expected)
        assert eval(printed, {**RUNTIME, "sample": sample}) == pytest.approx(expected, rel=1e-12)


def test_an_input_that_is_read_early_is_written_at_its_own_sample():
    early = make_model(
        [
            (parse("y(k-1)"), 0.5),
            (parse("u1(k-1)*u2(k-1)"), 2.0),
            (parse("phi1(u1(k-1), u1(k-2))"), 3.0),
        ],
        ("u_V+1", "w"),
        "y_um",
    )
    assert equation(early) == "y(k) = 0.5*y(k-1) + 2*u1(k)*u2(k-1) + 3*(u1(k) - u1(k-1))"
    assert named_equation(early) == "y_um(k) = 0.5*y_um(k-1) + 2*u_V(k)*w(k-1) + 3*(u_V(k) - u_V(k-1))"
    assert named_term(early, 1) == "u_V(k)*w(k-1)"
    assert r"u_{1,k} u_{2,k-1}" in latex_equation(early)
    assert "<mn>1</mn><mo>,</mo><mi>k</mi></mrow>" in mathml_equation(early)


def test_statements_have_the_names_and_the_samples_of_the_record():
    terms = [(parse("u1(k-1)*u2(k-1)"), 1.0)]
    model = make_model(terms, ("flow (l/s)", "valve"), "T")
    statement = "[u1(k-1)] - 2*[y(k-2)*u2(k-3)^2] = 1"
    assert named_statement(statement, model) == "[flow(k-1)] - 2*[T(k-2)*valve(k-3)^2] = 1"
    assert named_statement("gain(u2) = 2 at 1, 0, 3", model) == "gain(valve) = 2 at 1, 0, 3"
    assert named_statement("gain(u) = 2", model) == "gain(flow) = 2"
    assert named_statement("odd", model) == "odd"
    early = make_model(terms, ("u_V+1", "w"), "y_um")
    assert named_statement("[u1(k-1)*u2(k-1)] <= 0", early) == "[u_V(k)*w(k-1)] <= 0"


def test_equation_without_parameters_numbers_them():
    bare = make_model(
        [(parse("y(k-1)"), 1.0), (parse("u1(k-1) + u2(k-1)"), 1.0), (parse("1"), 1.0)], ("u1", "u2")
    )
    bare = type(bare)(bare.regressors, input_names=bare.input_names)
    assert equation(bare) == "y(k) = theta1*y(k-1) + theta2*(u1(k-1) + u2(k-1)) + theta3"
    assert latex_equation(bare) == (
        r"y_{k} = \theta_{1} \, y_{k-1} + \theta_{2} \, \left(u_{1,k-1} + u_{2,k-1}\right) + \theta_{3}"
    )


#: Functions of an equation as NumPy has them; `div` is that of the page on expressions.
_NUMPY = {name: getattr(np, name) for name in ("sqrt", "exp", "log", "abs", "sign", "tanh", "sin", "cos")} | {
    "min": np.minimum,
    "max": np.maximum,
    "div": lambda a, b: np.divide(a, b, out=np.zeros(np.broadcast(a, b).shape), where=np.asarray(b) != 0.0),
}


@pytest.mark.parametrize(
    "term",
    [
        "sqrt(u(k-1) - u(k-2))",
        "log(u(k-1) - 0.5*u(k-3))",
        "exp(90*u(k-1))",
        "y(k-1)/(u(k-1) - u(k-2))",
        "sqrt(log(u(k-1))*y(k-1))^3*(u(k-2)/y(k-1))^2",
        "tanh(u(k-1)/y(k-2)) + sqrt(exp(u(k-1)))",
    ],
)
def test_printed_equations_give_the_values_of_the_model(term):
    model = make_model([(parse(term), 0.5), (parse("y(k-1)"), 0.25)], ("valve",), "level")
    rng = np.random.default_rng(0)
    levels, valves = (rng.uniform(-2.0, 2.0, (5, 40)) for _ in range(2))
    valves[2, :10] = valves[1, :10]  # divisors of zero
    expected = sum(
        theta
        * np.array(
            [
                value(item.expression, lambda channel, lag, at=at: (levels, valves)[channel][lag, at])
                for at in range(40)
            ]
        )
        for item, theta in zip(model.regressors, model.parameters, strict=True)
    )
    for text, output, excitation in (
        (equation(model, 17), "y", "u"),
        (named_equation(model, 17), "level", "valve"),
    ):
        line = re.sub(r"\(k-(\d)\)", r"[\1]", text.partition(" = ")[2]).replace("^", "**")
        found = eval(line, dict(_NUMPY), {output: levels, excitation: valves})
        np.testing.assert_allclose(found, expected, rtol=1e-12)


# MathML: the visible text equals the plain text.

_PLAIN = {
    "\u2212": " - ",
    "+": " + ",
    "=": " = ",
    "\u2062": "*",
    "\u2061": "",
    "\u00d7": "e",
    "\u03b8": "theta",
}


def to_plain(element):
    """Return the visible content as plain text; only brackets group it, an ``mrow`` does not."""
    parts = [to_plain(child) for child in element]
    match element.tag, parts:
        case (("mi" | "mn" | "mo"), []):
            return _PLAIN.get(element.text, element.text)
        case "msub", ["theta", index]:
            return f"theta{index}"
        case "msub", [name, index]:
            channel, _, time = index.rpartition(",")
            return f"{name}{channel}({time.replace(' ', '')})"
        case "msup", ["10", exponent]:
            # Exponent of a number; a power of the constant 10 has brackets.
            return exponent.replace(" ", "")
        case "msup", ["q", exponent]:
            return f"q{exponent.removeprefix(' - ')}"
        case "msup", [base, exponent]:
            return f"{base}^{exponent}"
        case "msqrt", [inside]:
            return f"sqrt({inside})"
        case "mrow", ["|", inside, "|"]:
            return f"abs({inside})"
        case "mrow", ["ln", "", inside]:
            return f"log({inside})"
        case (("math" | "mrow" | "mtable" | "mtr" | "mtd"), _):
            return "".join(parts)
    raise AssertionError(ElementTree.tostring(element))


def visible_text(mathml_text):
    return to_plain(ElementTree.fromstring(mathml_text))


@pytest.mark.parametrize(
    ("text", "visible"),
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
        ("(u(k-1)/y(k-1))^2*(u(k-1)/y(k-2))", "div(u(k-1),y(k-1))^2*div(u(k-1),y(k-2))"),
        ("sqrt(y(k-1) + 2*u(k-1))^2*sqrt(u(k-1))", "(sqrt(abs(y(k-1) + 2*u(k-1))))^2*sqrt(abs(u(k-1)))"),
        ("log(y(k-1))^2*log(u(k-1) - 1)", "(log(abs(y(k-1))))^2*log(abs(u(k-1) - 1))"),
        ("max(u(k-1), exp(y(k-1)))", "max(u(k-1),exp(min(y(k-1),50)))"),
        ("u(k-1) - (y(k-1) - 1)", "u(k-1) - (y(k-1) - 1)"),
        ("u(k-1) + (-1)", "u(k-1) + ( - 1)"),
        ("phi2(u(k-1), u(k-2))", "phi2(u(k-1),u(k-2))"),
        ("q2(u(k-1)*y(k-1))", "q2*(u(k-1)*y(k-1))"),
        ("u(k-1)*q1(y(k-1))", "u(k-1)*(q1*y(k-1))"),
    ],
)
def test_mathml_of_an_expression_shows_its_plain_text(text, visible):
    assert visible_text(mathml(parse(text))) == visible


@given(models(inputs=2))
def test_mathml_of_every_model_shows_its_plain_equation(model):
    written = mathml_equation(model)
    left, _, shown = visible_text(written).partition(" = ")
    assert left == "y(k)"
    # Compare parsed expressions, because numbers and products have several notations.
    assert parse(shown) == parse(equation(model).removeprefix("y(k) = "))
