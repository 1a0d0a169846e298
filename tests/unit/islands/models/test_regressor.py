"""Regressors and their canonical form."""

import pytest

from islands.errors import ModelError
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.expressions.parsing import parse
from islands.expressions.primitives import MUL, PRIMITIVES
from islands.expressions.printing import plain
from islands.expressions.tree import Apply, Lagged
from islands.expressions.user_primitive import primitive
from islands.models.regressor import CanonicalForms, regressor
from support.variation import random_gene


def canonical_text(text):
    factor, item = regressor(parse(text))
    return factor, item and plain(item.expression)


@pytest.mark.parametrize(
    ("text", "factor", "core"),
    [
        ("u(k-1)*y(k-1)*3", 3.0, "y(k-1)*u(k-1)"),
        ("-(u(k-1)*-2)", 2.0, "u(k-1)"),
        ("q2(u(k-1)*q1(y(k-3)))", 1.0, "y(k-6)*u(k-3)"),
        ("7", 7.0, "1"),
        ("2*u(k-1) + 4*y(k-1)", 4.0, "y(k-1) + 0.5*u(k-1)"),
        ("u(k-2) - u(k-1)", -1.0, "u(k-1) - u(k-2)"),
        ("3*u(k-1) - 3*u(k-2)", 3.0, "u(k-1) - u(k-2)"),
        ("u(k-1) + 1 - u(k-1)", 1.0, "1"),
        ("u(k-1) - (y(k-1) - u(k-1))", -1.0, "y(k-1) + (-2)*u(k-1)"),
        ("phi2(u(k-4), u(k-1))", -1.0, "sign(u(k-1) - u(k-4))"),
        ("square(u(k-1)*2)", 4.0, "u(k-1)^2"),
        ("cube(-u(k-1))*u(k-1)", -1.0, "u(k-1)^4"),
        ("sqrt(-9*u(k-1))", 3.0, "sqrt(u(k-1))"),
        ("abs(u(k-2) - u(k-1))", 1.0, "abs(u(k-1) - u(k-2))"),
        ("tanh(-2*u(k-1))", -1.0, "tanh(2*u(k-1))"),
        ("cos(y(k-1) - 2*u(k-1))", 1.0, "cos(y(k-1) + (-2)*u(k-1))"),
        ("exp(2 - 2)", 1.0, "1"),
        ("sign(5*sign(-u(k-1)))", -1.0, "sign(u(k-1))"),
        ("sign(u(k-1))^5*y(k-1)", 1.0, "y(k-1)*sign(u(k-1))"),
        ("sign(u(k-1))^4", 1.0, "sign(u(k-1))^2"),
        ("sign(u(k-1))*sign(y(k-1))*sign(u(k-1))", 1.0, "sign(y(k-1))*sign(u(k-1))^2"),
        ("u(k-1)*sign(-2*u(k-1))^2", 1.0, "u(k-1)"),
        ("u(k-1)^3*sign(u(k-1))^4*y(k-1)", 1.0, "y(k-1)*u(k-1)^3"),
        ("abs(u(k-1))*sign(u(k-1))^2", 1.0, "abs(u(k-1))"),
        ("phi1(u(k-2), u(k-1))*phi2(u(k-1), u(k-2))^2", -1.0, "u(k-1) - u(k-2)"),
        ("u(k-1)*(u(k-1)/u(k-1))", 1.0, "u(k-1)"),
        ("u(k-1)*sign(u(k-1))^3", 1.0, "u(k-1)*sign(u(k-1))"),
        ("u(k-1)*sign(y(k-1))^2", 1.0, "u(k-1)*sign(y(k-1))^2"),
        ("u(k-1)/u(k-1)", 1.0, "sign(u(k-1))^2"),
        ("3*u(k-1)/(2*u(k-1))", 1.5, "sign(u(k-1))^2"),
        ("u(k-1)/(-4)", -0.25, "u(k-1)"),
        ("u(k-1)/1e-12", 1e12, "u(k-1)"),
        ("y(k-1) + u(k-1)/0", 1.0, "y(k-1)"),
        ("u(k-1) + 0/y(k-1)", 1.0, "u(k-1)"),
        ("(u(k-2) - u(k-1))/(-4*y(k-1))", 0.25, "(u(k-1) - u(k-2))/y(k-1)"),
        ("8/(2*y(k-1))", 4.0, "1/y(k-1)"),
        ("u(k-1)/(u(k-2)/y(k-1))", 1.0, "(y(k-1)*u(k-1))/u(k-2)"),
        ("(2*u(k-1)/u(k-2))/y(k-1)", 2.0, "u(k-1)/(y(k-1)*u(k-2))"),
        ("(u(k-1)/y(k-1))/(u(k-1)/y(k-1))", 1.0, "sign(u(k-1)/y(k-1))^2"),
        ("max(u(k-1), y(k-1))", 1.0, "max(y(k-1), u(k-1))"),
        ("min(2*u(k-1), u(k-1) + u(k-1))", 2.0, "u(k-1)"),
        ("log(-u(k-1))", 1.0, "log(u(k-1))"),
    ],
)
def test_canonical_form_of_an_expression(text, factor, core):
    assert canonical_text(text) == (pytest.approx(factor, rel=1e-15), core)


@pytest.mark.parametrize(
    "text",
    [
        "0",
        "0*u(k-1)",
        "u(k-1) - u(k-1)",
        "phi1(u(k-3), u(k-3))",
        "phi2(u(k-3), u(k-3))*y(k-1)",
        "phi1(q2(u(k-1)), u(k-3))",
        "tanh(u(k-2) - q1(u(k-1)))",
        "q1(0)",
        "log(1)",
        "2*u(k-1)*y(k-1) - y(k-1)*u(k-1)*2",
    ],
)
def test_expression_that_is_identically_zero_has_no_regressor(text):
    assert regressor(parse(text)) == (0.0, None)


@pytest.mark.parametrize(
    "text",
    ["1e200*1e200", "exp(1e200*1e200*u(k-1))", "1e-310*y(k-1) + u(k-1)", "1e308*u(k-1) + 1e308*u(k-1)"],
)
def test_overflowing_numbers_are_refused(text):
    with pytest.raises(ModelError, match="the numbers in an expression overflow: take smaller ones"):
        regressor(parse(text))


def test_error_in_constant_folding_names_the_user_primitive():
    pole = primitive("pole", lambda a: 1.0 / (a - 0.125))
    with pytest.raises(ModelError, match=r"'pole' fails at \[0\.125\] \(float division by zero\)"):
        regressor(parse("u(k-1) + pole(0.125)", {**PRIMITIVES, "pole": pole}))


def test_known_forms_do_not_change_a_regressor():
    setting = Settings(
        structure="free", primitives=("mul", "add", "sub", "sign", "abs", "tanh", "phi2"), initial_height=5
    )
    draw, forms = Stream(5, 0, 0, Purpose.INITIAL), CanonicalForms()
    genes = [random_gene(setting, 2, draw) for _ in range(400)]
    for each in (*genes, *genes[:20]):
        assert repr(regressor(each, forms)) == repr(regressor(each))
    # The test is meaningful only if parts and regressors are found again.
    assert len(forms.regressors) < len(genes)
    assert regressor(genes[0], forms)[1] is regressor(genes[0], forms)[1]
    for _ in range(2):
        with pytest.raises(ModelError, match="overflow"):
            regressor(parse("1e300*u(k-1)*1e300"), forms)
        with pytest.raises(ModelError, match="past samples"):
            regressor(Apply(MUL, (Lagged(0, 1), Lagged(1, 0))), forms)
