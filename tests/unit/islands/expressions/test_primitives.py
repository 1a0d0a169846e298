"""Primitives: values and declared properties of the table, and checks of user-defined primitives."""

import math

import pytest

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.primitives import LARGEST_EXPONENT, PRIMITIVES
from islands.expressions.printing import latex, plain
from islands.expressions.tree import Primitive
from islands.expressions.user_primitive import check, primitive
from islands.models.regressor import canonical


@pytest.mark.parametrize("entry", PRIMITIVES.values(), ids=list(PRIMITIVES))
def test_built_in_primitive_is_finite_and_has_its_declared_properties(entry):
    check(entry)
    assert PRIMITIVES[entry.name] is entry


@pytest.mark.parametrize(
    ("name", "arguments", "result"),
    [
        ("mul", (3.0, -2.0), -6.0),
        ("sub", (3.0, -2.0), 5.0),
        ("add", (3.0, -2.0), 1.0),
        ("sign", (-0.3,), -1.0),
        ("sign", (0.0,), 0.0),
        ("phi1", (7.0, 4.0), 3.0),
        ("phi2", (7.0, 4.0), 1.0),
        ("phi2", (4.0, 7.0), -1.0),
        ("phi2", (4.0, 4.0), 0.0),
        ("div", (1.0, 8.0), 0.125),
        ("div", (5.0, 0.0), 0.0),
        ("div", (0.0, -0.0), 0.0),
        ("div", (4e-10, 2e-10), 2.0),
        ("div", (0.0, 5e-324), 0.0),
        ("abs", (-2.5,), 2.5),
        ("square", (-3.0,), 9.0),
        ("cube", (-3.0,), -27.0),
        ("sqrt", (-9.0,), 3.0),
        ("exp", (1.0,), math.e),
        ("exp", (1e6,), math.exp(LARGEST_EXPONENT)),
        ("log", (-math.e,), 1.0),
        ("log", (0.0,), 0.0),
        ("log", (-math.exp(-30.0),), -30.0),
        ("sin", (math.pi / 2,), 1.0),
        ("cos", (math.pi,), -1.0),
        ("tanh", (1e3,), 1.0),
        ("max", (2.0, -7.0), 2.0),
        ("min", (2.0, -7.0), -7.0),
    ],
)
def test_built_in_primitive_returns_the_expected_value(name, arguments, result):
    assert PRIMITIVES[name].scalar(*arguments) == pytest.approx(result, rel=1e-15)


def saturation(a):
    return a / (1.0 + abs(a))


def test_user_primitive_is_rendered_parsed_and_canonicalised():
    table = {**PRIMITIVES, "soft_clip": primitive("soft_clip", saturation, parity=-1)}
    expression = parse("soft_clip(-2*u(k-1))*y(k-1)", table)
    assert plain(expression) == "soft_clip((-2)*u(k-1))*y(k-1)"
    assert parse(plain(expression), table) == expression
    assert latex(expression) == r"\operatorname{soft\_clip}(\left(-2\right) u_{k-1}) y_{k-1}"
    factor, core = canonical(expression)
    assert (factor, plain(core)) == (-1.0, "y(k-1)*soft_clip(2*u(k-1))")


@pytest.mark.parametrize(
    "name",
    [
        "mul",
        "tanh",
        "phi1",
        "y",
        "u",
        "u2",
        "k",
        "q1",
        "q12",
        "soft clip",
        "2nd",
        "",
        "lambda",
        "not",
        "None",
    ],
)
def test_primitive_name_that_is_taken_or_invalid_is_refused(name):
    with pytest.raises(ModelError, match="cannot name a primitive: use an identifier that is not in use"):
        primitive(name, saturation)


@pytest.mark.parametrize(
    ("scalar", "message"),
    [
        (lambda: 1.0, "takes 0 arguments: a primitive must take one or two"),
        (lambda a, b, c: a + b + c, "takes 3 arguments: a primitive must take one or two"),
        (max, "has no signature: wrap it in a function of one or two arguments"),
    ],
)
def test_primitive_with_wrong_number_of_arguments_is_refused(scalar, message):
    with pytest.raises(ModelError, match=message):
        primitive("mine", scalar)


@pytest.mark.parametrize(
    ("scalar", "message"),
    [
        (lambda a: 1.0 / a, r"'mine' fails at \(0\.0,\) \(float division by zero\): protect it there"),
        (math.sqrt, r"'mine' fails at \(-1\.0,\) \(math domain error\): protect it there"),
        (lambda a: a**0.5, r"'mine' fails at \(-1\.0,\) \(.*complex.*\): protect it there"),
        (lambda a: math.exp(abs(a)), r"'mine' fails at \(1000\.0,\) \(math range error\): protect it there"),
        (lambda a: math.inf if a > 10.0 else a, r"'mine' is inf at \(1000\.0,\): protect it there"),
        (lambda a: math.nan if a < -40.0 else a, r"'mine' is nan at \(-41\.0,\): protect it there"),
        (lambda a: a or None, r"'mine' fails at \(0\.0,\) \(.*NoneType.*\)"),
        (lambda a, b: a / b, r"'mine' fails at \(0\.0, 0\.0\) \(float division by zero\): protect it there"),
    ],
)
def test_primitive_error_names_the_argument_with_a_non_finite_value(scalar, message):
    with pytest.raises(ModelError, match=message):
        primitive("mine", scalar)


@pytest.mark.parametrize(
    ("scalar", "parity"), [(math.cos, -1), (math.tanh, 1), (lambda a: a + 1.0, -1), (lambda a: a * a + a, 1)]
)
def test_false_parity_is_refused(scalar, parity):
    with pytest.raises(ModelError, match=rf"declares parity {parity}, which is false at"):
        primitive("mine", scalar, parity=parity)


@pytest.mark.parametrize("scalar", [lambda a, b: a - b, lambda a, b: a + 2.0 * b])
def test_false_commutativity_is_refused(scalar):
    with pytest.raises(ModelError, match="declares that it commutes, which is false at"):
        primitive("mine", scalar, commutative=True)


def test_false_degree_is_refused():
    with pytest.raises(ModelError, match=r"declares degree 2\.0, which is false at"):
        check(Primitive("mine", 1, abs, "{0}", degree=2.0))


def test_parity_and_degree_of_a_binary_primitive_are_refused():
    # Canonicalisation extracts the sign of the first argument and would ignore the second.
    for wrong in ({"parity": -1}, {"degree": 1.0}):
        with pytest.raises(ModelError, match="has two arguments: parity and degree require one argument"):
            check(Primitive("mine", 2, lambda a, b: a + b, "{0} + {1}", **wrong))


@pytest.mark.parametrize("wrong", [r"\frac{1}{2}{0}", r"\foo{x}{0}", "{", r"{0}^{"])
def test_primitive_with_invalid_latex_format_is_refused(wrong):
    with pytest.raises(ModelError, match=r"the LaTeX of primitive 'mine' is not a format string of \{0\}"):
        primitive("mine", saturation, latex=wrong)
