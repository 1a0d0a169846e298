"""Infix source has the value of the expression."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.errors import ModelError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Lagged
from islands.models.regressor import regressor
from islands_measurements.speed.expression_source import infix
from support.strategies import signals

_LEAVES = st.one_of(
    st.builds(Lagged, st.integers(0, 1), st.integers(1, 5)), st.builds(Constant, st.sampled_from([-0.5, 2.0]))
)


def _over(below):
    several = st.lists(below, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        st.builds(Apply, st.sampled_from([MUL, ADD]), several),
        st.builds(lambda a, b: Apply(SUB, (a, b)), below, below),
        st.builds(lambda a, b: Apply(PRIMITIVES["phi2"], (a, b)), below, below),
        st.builds(lambda a: Apply(SIGN, (a,)), below),
    )


@given(expression=st.recursive(_LEAVES, _over, max_leaves=12), signal=signals())
def test_python_source_has_the_value_of_the_expression(expression, signal):
    _, item = regressor(expression)
    if item is None:
        return
    source = infix(item.expression, lambda channel, lag: f"signal({channel}, {lag})")
    read = eval(source, {"sign": np.sign, "signal": signal})
    assert read == value(item.expression, signal)


def test_negative_number_and_difference_keep_their_brackets():
    expression = Apply(MUL, (Constant(-0.5), Apply(SUB, (Lagged(0), Lagged(1, 2)))))
    assert infix(expression, lambda channel, lag: f"{'yu'[channel]}{lag}") == "((-0.5)*(y1 - u2))"


@pytest.mark.parametrize("text", ["tanh(y(k-1))", "y(k-1)*max(u(k-1), u(k-2))"])
def test_function_unknown_to_the_baselines_is_refused(text):
    with pytest.raises(ModelError, match="products, sums, differences and signs"):
        infix(regressor(parse(text))[1].expression, lambda _channel, lag: f"s{lag}")
