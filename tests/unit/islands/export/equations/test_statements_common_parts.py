"""Common parts of expressions: the value is unchanged, and no part of some size remains twice."""

import numpy as np
import pytest

from islands.export.equations.statements import take_common_parts
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.expressions.printing import render
from islands.kernels.curve import VALUES, write_curve


def test_a_part_that_occurs_twice_is_computed_once():
    parts, (rest,) = take_common_parts([parse_expression("(a*b + c*d + a)*2 - (a*b + c*d + a)")], "part")
    assert [(name, render(each)) for name, each in parts] == [("part1", "a*b + c*d + a")]
    assert render(rest) == "part1*2 - part1"


@pytest.mark.parametrize("place", [-1.2, -0.4, 0.1, 0.9])
def test_parts_follow_those_that_they_read(place):
    expression = parse_expression(write_curve("x/3"))
    parts, (rest,) = take_common_parts([expression], "part")
    values = {"x": 3.0 * place, **{f"n{index}": np.sin(index + 1.0) for index in range(VALUES)}}
    expected = evaluate(expression, values)
    for name, part in parts:
        values[name] = evaluate(part, values)
    assert evaluate(rest, values) == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert len(render(rest)) < 0.5 * len(render(expression))
