"""Row functions: a primitive's scalar function, compiled for a whole row and called through its address.

The interpreter therefore does not depend on the table of primitives, and a user-defined function is as fast
as a built-in one.
"""

from functools import cache
from typing import Any

from numba import types
from numba.core.errors import NumbaError
from numba.extending import register_jitable

from islands.errors import ModelError
from islands.expressions.tree import Primitive
from islands.kernels.jit_cache import compile_callback

_ROW = types.CPointer(types.float64)
_SIGNATURE = types.void(_ROW, _ROW, _ROW, types.int64)


def row_address(primitive: Primitive) -> int:
    """Return the machine address of ``void (double *target, double *first, double *second, int64 lanes)``.

    Raises
    ------
    ModelError
        The scalar function does not compile.
    """
    return int(_compile(primitive.scalar, primitive.arity, primitive.name).address)


@cache
def _compile(scalar: Any, arity: int, name: str) -> Any:
    scalar = register_jitable(scalar)

    def unary(target: Any, first: Any, _second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane])

    def binary(target: Any, first: Any, second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane], second[lane])

    try:
        return compile_callback(unary if arity == 1 else binary, _SIGNATURE)
    except NumbaError as error:
        raise ModelError(
            f"primitive {name!r} does not compile; use arithmetic, comparisons and math alone: {error}"
        ) from error
