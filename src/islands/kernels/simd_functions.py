"""Functions of SIMD vectors besides sums and products: quotient, root, exponential, selection."""

from collections.abc import Callable
from math import factorial, log
from typing import Any

from llvmlite import ir
from numba import literal_unroll
from numba.extending import intrinsic

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, broadcast, elementwise, multiply, subtract

_VECTOR = ir.VectorType(ir.DoubleType(), VECTOR)
_BITS = ir.VectorType(ir.IntType(64), VECTOR)

#: Adding this number rounds to an integer, which is in the last bits of the sum.
_ROUNDING = 1.5 * 2.0**52

#: Bits of the fraction of a float64.
_FRACTION_BITS = 52

#: The logarithm of 2 in two parts, of which the first has few digits, and its inverse.
_LOG_2_HIGH, _LOG_2_LOW, _INVERSE_LOG_2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10, 1 / log(2)

#: Largest absolute argument of the exponential; the result is finite and not subnormal.
_LARGEST_EXPONENT = 708.0

#: Coefficients of the Taylor series of the exponential, the largest power first. Its argument is at most
#: half the logarithm of 2.
_TAYLOR = tuple(1 / factorial(power) for power in range(13, -1, -1))


@intrinsic
def divide(_typingctx, a, b):
    """Return ``a / b``."""
    return a(a, b), elementwise(lambda builder, x, y: builder.fdiv(x, y))


@intrinsic
def negate(_typingctx, a):
    """Return ``-a``."""
    return a(a), elementwise(lambda builder, x: builder.fneg(x))


@intrinsic
def absolute(_typingctx, a):
    """Return ``|a|``."""
    return a(a), elementwise(_call_intrinsic("fabs"))


@intrinsic
def square_root(_typingctx, a):
    """Return the square root, correctly rounded; NaN for a negative number."""
    return a(a), elementwise(_call_intrinsic("sqrt"))


@intrinsic
def select_less(_typingctx, a, b, first, second):
    """Return ``first`` where ``a < b``, and ``second`` elsewhere, also where a or b is NaN."""
    return a(a, b, first, second), elementwise(_select("<"))


@intrinsic
def select_less_equal(_typingctx, a, b, first, second):
    """Return ``first`` where ``a <= b``, and ``second`` elsewhere, also where a or b is NaN."""
    return a(a, b, first, second), elementwise(_select("<="))


@intrinsic
def _add_to_exponent(_typingctx, a, rounded):
    """Return ``a * 2**n`` for the integer n of which ``rounded`` is the sum with `_ROUNDING`."""

    def one(builder, x, n):
        width = ir.Constant(_BITS, [_FRACTION_BITS] * VECTOR)
        shifted = builder.shl(builder.bitcast(n, _BITS), width)
        return builder.bitcast(builder.add(builder.bitcast(x, _BITS), shifted), _VECTOR)

    return a(a, rounded), elementwise(one)


@kernel(forceinline=True)
def clip(a, bound):
    """Return the nearest number between ``-bound`` and ``bound`` per lane."""
    upper, lower = broadcast(bound, 1), broadcast(-bound, 1)
    below = select_less(a, upper, a, upper)
    return select_less(below, lower, lower, below)


@kernel(forceinline=True)
def exponential(a):
    """Return the exponential of one vector, to 1e-15 of its value; finite where it would overflow."""
    x = clip(a, _LARGEST_EXPONENT)
    rounding = broadcast(_ROUNDING, 1)
    rounded = add(multiply(x, broadcast(_INVERSE_LOG_2, 1)), rounding)
    n = subtract(rounded, rounding)
    rest = subtract(x, multiply(n, broadcast(_LOG_2_HIGH, 1)))
    rest = subtract(rest, multiply(n, broadcast(_LOG_2_LOW, 1)))
    value = broadcast(_TAYLOR[0], 1)
    for coefficient in literal_unroll(_TAYLOR[1:]):
        value = add(multiply(value, rest), broadcast(coefficient, 1))
    return _add_to_exponent(value, rounded)


@kernel(forceinline=True)
def hyperbolic_tangent(a):
    """Return the hyperbolic tangent of one vector, to 1e-15."""
    one, two = broadcast(1.0, 1), broadcast(2.0, 1)
    return subtract(one, divide(two, add(exponential(multiply(two, a)), one)))


def _select(comparison: str) -> Callable[..., Any]:
    return lambda builder, a, b, first, second: builder.select(
        builder.fcmp_ordered(comparison, a, b), first, second
    )


def _call_intrinsic(name: str) -> Callable[..., Any]:
    """Return the code generator of a call of LLVM's function of this name for a whole vector."""

    def generate(builder: Any, x: Any) -> Any:
        full = f"llvm.{name}.v{VECTOR}f64"
        function = builder.module.globals.get(full)
        if function is None:
            function = ir.Function(builder.module, ir.FunctionType(_VECTOR, [_VECTOR]), full)
        return builder.call(function, [x])

    return generate
