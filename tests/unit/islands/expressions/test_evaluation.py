"""Values of expressions of lagged signals."""

import pytest

from islands.errors import ModelError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import MUL
from islands.expressions.tree import Apply, Constant, Symbol


def test_value_of_an_expression_matches_a_hand_calculation():
    def signal(channel, lag):
        return 10.0 * channel + lag

    assert value(parse("y(k-2) - 2*u1(k-3)*u2(k-1)"), signal) == 2.0 - 2.0 * 13.0 * 21.0
    assert value(parse("q4(u(k-1)/y(k-1)) + sign(y(k-1) - u(k-1))"), signal) == 15.0 / 5.0 - 1.0
    assert value(Apply(MUL, (Constant(2.0),) * 10), signal) == 1024.0


@pytest.mark.parametrize("node", ["u", Symbol("u")])
def test_value_of_a_node_without_a_lag_is_refused(node):
    with pytest.raises(ModelError, match=r"'u'.* is not an expression: use Lagged, Constant, Shift or Apply"):
        value(node, lambda *_: 0.0)
