"""Partial derivatives with respect to past outputs, compared with derivatives along a direction."""

import math

import pytest

import islands
from islands.expressions.derivatives import differentiate
from islands.expressions.evaluation import value
from islands.expressions.output_derivatives import differentiate_by_outputs
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Lagged
from islands.models.regressor import canonical, regressor

SIGNALS = {(0, 1): -1.3, (0, 2): 0.4, (0, 3): 2.1, (1, 1): 0.7, (1, 2): -0.2}


def derivatives(expression, read=lambda channel, lag: SIGNALS[channel, lag]):
    """Return the derivative with respect to the output at each lag."""
    found = {}
    for lag, weight, factors in differentiate_by_outputs(expression):
        product = math.prod(float(value(each, read)) for each in factors)
        found[lag] = found.get(lag, 0.0) + weight * product
    return found


def make_regressor(text):
    return regressor(parse(text))[1].expression


@pytest.mark.parametrize("output", [-1.3, 0.6])
@pytest.mark.parametrize("entry", PRIMITIVES.values(), ids=list(PRIMITIVES))
def test_each_primitive_has_the_derivative_along_a_direction(entry, output):
    """With all outputs moved alike, the derivatives for all lags add to it."""
    inner = (parse("y(k-1)*u(k-1)"), parse("y(k-2) + u(k-2)"))
    _, form = canonical(Apply(entry, inner[: entry.arity]))
    _, expected = differentiate(form, (output, 0.7).__getitem__, (1.0, 0.0).__getitem__)
    found = sum(derivatives(form, lambda channel, _: (output, 0.7)[channel]).values())
    assert found == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "at_zero"), [("abs(y(k-1))", 0.0), ("sqrt(y(k-1))", 0.0), ("max(y(k-1), 0)", 0.5)]
)
def test_derivative_at_a_kink_is_finite(text, at_zero, monkeypatch):
    monkeypatch.setitem(SIGNALS, (0, 1), 0.0)
    assert derivatives(make_regressor(text)) == {1: at_zero}


def test_derivative_of_a_primitive_of_the_user_is_not_known():
    own = islands.primitive("soften", lambda a: a / (1.0 + abs(a)))
    assert differentiate_by_outputs(Apply(own, (Lagged(0, 1),))) is None
    assert differentiate_by_outputs(Apply(own, (Lagged(1, 1),))) == ()
