"""The row function of a primitive equals its Python function on every lane."""

import ctypes
import decimal
import math

import numpy as np
import pytest

from islands.errors import ModelError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.program import primitive_functions
from islands.program.primitive_functions import row_address

ROW = ctypes.POINTER(ctypes.c_double)
PROBES = [0.0, 1.0, -1.0, 0.3, -0.7, 2.5, -41.0, 60.0, 1e3, 1e-10, -1e-12]


def run(entry, *arguments):
    """Call the machine address on whole rows; return the target row, which has one additional lane."""
    function = ctypes.CFUNCTYPE(None, ROW, ROW, ROW, ctypes.c_int64)(row_address(entry))
    rows = [np.array(values) for values in (arguments[0], arguments[-1])]
    target = np.full(len(rows[0]) + 1, 99.0)
    function(*(row.ctypes.data_as(ROW) for row in (target, *rows)), len(rows[0]))
    return target


def expected(entry, *arguments):
    return [entry.scalar(*values) for values in zip(*arguments, strict=True)]


@pytest.mark.ci
@pytest.mark.parametrize("entry", PRIMITIVES.values(), ids=list(PRIMITIVES))
def test_row_function_equals_its_scalar_function_on_every_lane(entry):
    pairs = [PROBES] if entry.arity == 1 else zip(*[(a, b) for a in PROBES for b in PROBES], strict=True)
    arguments = [list(values) for values in pairs]
    found = run(entry, *arguments)
    np.testing.assert_allclose(found[:-1], expected(entry, *arguments), rtol=4e-16, atol=0.0)
    assert found[-1] == 99.0


def test_user_defined_function_runs_through_its_address():
    def dead_zone(a, b):
        width = abs(b)
        return math.copysign(abs(a) - width, a) if abs(a) > width else 0.0

    entry = primitive("dead_zone", dead_zone)
    first, second = [3.0, -3.0, 0.5, -7.0], [1.0, 1.0, 1.0, -2.5]
    assert run(entry, first, second)[:-1].tolist() == [2.0, -2.0, 0.0, -4.5]
    assert expected(entry, first, second) == [2.0, -2.0, 0.0, -4.5]


@pytest.mark.ci
def test_uncompilable_function_is_refused():
    entry = primitive("slow", lambda a: float(decimal.Decimal(a)))
    with pytest.raises(
        ModelError, match="primitive 'slow' does not compile; use arithmetic, comparisons and math"
    ):
        row_address(entry)


def test_row_function_of_a_user_is_compiled_in_every_process():
    def half(a):
        return a / 2.0

    entry = primitive("half", half)
    row_address(entry)
    assert primitive_functions._compile.__wrapped__(entry.scalar, 1, "half").cache_hits == 0
