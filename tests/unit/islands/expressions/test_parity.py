"""Parity of expressions."""

import numpy as np
import pytest

from islands.expressions.evaluation import value
from islands.expressions.parity import parity
from islands.expressions.parsing import parse

ODD = [
    "u(k-1)",
    "y(k-2)^3",
    "u(k-1)*abs(y(k-1))",
    "u(k-1) - y(k-3)",
    "tanh(u(k-1) + y(k-1))",
    "sin(y(k-1))*cos(u(k-1))",
]
EVEN = ["1", "u(k-1)*y(k-1)", "abs(u(k-1))", "exp(u(k-1)^2)", "max(y(k-1)^2, cos(u(k-2)))", "sign(u(k-1))^2"]
NEITHER = ["u(k-1) + u(k-1)^2", "exp(u(k-1))", "max(u(k-1), y(k-1))", "tanh(1 + u(k-1))"]


def always(_channel):
    return True


@pytest.mark.parametrize(
    ("text", "expected"),
    [*((text, -1) for text in ODD), *((text, 1) for text in EVEN), *((text, 0) for text in NEITHER)],
)
def test_parity_is_that_of_the_value(text, expected):
    expression = parse(text)
    assert parity(expression, always) == expected
    signals = np.random.default_rng(0).normal(size=(2, 5))
    here, there = (
        value(expression, lambda channel, lag, s=s: s * signals[channel, lag]) for s in (1.0, -1.0)
    )
    if expected:
        assert there == pytest.approx(expected * here, rel=1e-14)
    else:
        assert abs(there) != pytest.approx(abs(here))
