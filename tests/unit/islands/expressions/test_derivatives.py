"""Derivatives of expressions along a direction."""

import math

import pytest

import islands
from islands.expressions.derivatives import _PARTIALS, differentiate
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Lagged, walk
from islands.models.regressor import canonical

U, Y = 0.7, -1.3


def slopes(expression, u=U, y=Y):
    """Return the derivatives with respect to u and y."""
    signals = (y, u)
    return tuple(
        differentiate(expression, signals.__getitem__, lambda channel, along=along: float(channel == along))[
            1
        ]
        for along in (1, 0)
    )


@pytest.mark.parametrize(
    ("text", "du", "dy"),
    [
        ("u(k-1)*y(k-2)^2", Y**2, 2 * U * Y),
        ("u(k-1) - 3*y(k-1)", 1.0, -3.0),
        ("u(k-1)/y(k-1)", 1 / Y, -U / Y**2),
        ("abs(y(k-1))", 0.0, -1.0),
        ("sqrt(y(k-1))", 0.0, -0.5 / math.sqrt(-Y)),
        ("exp(u(k-1)*y(k-1))", Y * math.exp(U * Y), U * math.exp(U * Y)),
        ("log(y(k-1))", 0.0, 1 / Y),
        ("sin(u(k-1))*cos(y(k-1))", math.cos(U) * math.cos(Y), -math.sin(U) * math.sin(Y)),
        ("tanh(u(k-1))", 1 - math.tanh(U) ** 2, 0.0),
        ("max(u(k-1), y(k-1))", 1.0, 0.0),
        ("min(u(k-1), y(k-1))", 0.0, 1.0),
        ("sign(u(k-1))*y(k-1)", 0.0, 1.0),
        ("q3(u(k-1))", 1.0, 0.0),
        ("2", 0.0, 0.0),
    ],
)
def test_derivatives_are_exact(text, du, dy):
    assert slopes(parse(text)) == pytest.approx((du, dy), rel=1e-14)


@pytest.mark.parametrize("entry", PRIMITIVES.values(), ids=list(PRIMITIVES))
def test_canonical_form_of_each_primitive_has_exact_derivatives(entry):
    """Those of a primitive without an entry are differences, with an error of 1e-10."""
    _, form = canonical(Apply(entry, tuple(map(Lagged, range(entry.arity)))))
    called = {part.primitive.name for part in walk(form) if isinstance(part, Apply)}
    assert called - _PARTIALS.keys() == set()


@pytest.mark.parametrize(
    "text", ["abs(u(k-1))", "sign(u(k-1))", "sqrt(u(k-1))", "max(u(k-1), y(k-1))", "log(u(k-1))"]
)
def test_derivative_at_a_kink_is_nan(text):
    assert math.isnan(slopes(parse(text), u=0.0, y=0.0)[0])


@pytest.mark.parametrize(("scale", "at"), [(1.0, 0.3), (100.0, -40.0)])
def test_user_primitive_has_a_derivative_of_ten_digits(scale, at):
    softplus = islands.primitive("softplus", lambda a: math.log1p(math.exp(min(a, 50.0) / 100.0)))
    expression = Apply(PRIMITIVES["mul"], (Lagged(1), Apply(softplus, (Lagged(1),))))
    e = math.exp(at / 100.0)
    expected = math.log1p(e) + at * e / (1 + e) / 100.0
    assert slopes(expression, u=at)[0] == pytest.approx(expected, rel=1e-10)
