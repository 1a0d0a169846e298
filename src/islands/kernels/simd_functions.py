"""Functions of SIMD vectors besides sums and products: quotient, root, absolute value, selection."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.extending import intrinsic

from islands.kernels.simd import VECTOR, elementwise

_VECTOR = ir.VectorType(ir.DoubleType(), VECTOR)


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
