"""Row functions: a primitive's scalar function, compiled for a whole row and called through its address.

So the machine need not know the primitives: an entry in their table is enough, and a user's own function runs
at the speed of a built-in one.
"""

from functools import cache
from typing import Any

from numba import cfunc, types
from numba.core.errors import NumbaError
from numba.extending import register_jitable

from islands.errors import ModelError
from islands.model.expression import Primitive

_ROW = types.CPointer(types.float64)
_SIGNATURE = types.void(_ROW, _ROW, _ROW, types.int64)


def row_address(primitive: Primitive) -> int:
    """Return the machine address of ``void (double *target, double *first, double *second, int64 lanes)``.

    Raises
    ------
    ModelError
        The scalar function does not compile.
    """
    return int(_compiled(primitive.scalar, primitive.arity, primitive.name).address)


@cache
def _compiled(scalar: Any, arity: int, name: str) -> Any:
    scalar = register_jitable(scalar)

    def unary(target: Any, first: Any, _second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane])

    def binary(target: Any, first: Any, second: Any, lanes: Any) -> None:
        for lane in range(lanes):
            target[lane] = scalar(first[lane], second[lane])

    try:
        return cfunc(_SIGNATURE, error_model="numpy")(unary if arity == 1 else binary)
    except NumbaError as error:
        raise ModelError(
            f"primitive {name!r} does not compile; use arithmetic, comparisons and math alone: {error}"
        ) from error
