"""The row machine: a flat program, and what one of its instructions does to a row of lanes.

A program never touches single numbers. Its operands are rows of ``lanes`` consecutive float64 of one flat
arena, so the cost of decoding an instruction is shared by the whole row and the inner loops vectorise. All
offsets are unsigned: a signed one makes the compiler guard every access against negative indices, which
keeps the loop from vectorising.

Nothing here is a reduction, so the processor's vector width cannot change a result.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

#: Instructions built into the machine; every other one calls a row function through its address.
ADD, SUBTRACT, MULTIPLY, SIGN, CALL = 0, 1, 2, 3, 4

#: The largest number of factors that one term multiplies on the fly.
MAX_FACTORS = 4


class Program(NamedTuple):
    """A flat three-address program over rows, and the terms that it prepares.

    Attributes
    ----------
    code : ndarray of int64, shape (instructions, 4)
        Operation, target temporary, first operand, second operand.
    addresses : ndarray of int64, shape (instructions,)
        Machine address of the row function that a CALL calls, else 0.
    operands : ndarray of int64, shape (operands, 2)
        Channel and lag, or -1 and the index of a temporary. Channel 0 is the output.
    constants : ndarray of float64
        The first temporaries hold these.
    temporaries : int
        Rows of temporaries, those of the constants included.
    factors : ndarray of int64, shape (terms, 4)
        Operands whose product is the term.
    degree : ndarray of int64, shape (terms,)
        How many factors a term has.
    """

    code: NDArray[np.int64]
    addresses: NDArray[np.int64]
    operands: NDArray[np.int64]
    constants: NDArray[np.float64]
    temporaries: int
    factors: NDArray[np.int64]
    degree: NDArray[np.int64]


_DOUBLES = ir.DoubleType().as_pointer()


@intrinsic
def call_row(_typingctx, address, target, first, second, lanes):
    """Call ``void (double *target, double *first, double *second, int64 lanes)`` at a machine address."""

    def generate(context, builder, _signature, arguments):
        integer = ir.IntType(64)
        prototype = ir.FunctionType(ir.VoidType(), [_DOUBLES, _DOUBLES, _DOUBLES, integer])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        rows = [builder.inttoptr(argument, _DOUBLES) for argument in arguments[1:4]]
        builder.call(function, [*rows, arguments[4]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, types.int64, types.int64), generate


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def execute(arena, operation, target, first, second, lanes, address):
    """Carry out one instruction on a row: ``arena[target] = operation(arena[first], arena[second])``.

    ``target``, ``first`` and ``second`` are the rows' offsets in the arena, ``lanes`` their length (uint64).
    """
    if operation == MULTIPLY:
        for lane in range(lanes):
            arena[target + lane] = arena[first + lane] * arena[second + lane]
    elif operation == SUBTRACT:
        for lane in range(lanes):
            arena[target + lane] = arena[first + lane] - arena[second + lane]
    elif operation == SIGN:
        for lane in range(lanes):
            value = arena[first + lane]
            arena[target + lane] = np.float64(value > 0.0) - np.float64(value < 0.0)
    elif operation == ADD:
        for lane in range(lanes):
            arena[target + lane] = arena[first + lane] + arena[second + lane]
    else:
        base = arena.ctypes.data
        call_row(
            address,
            base + np.int64(target) * 8,
            base + np.int64(first) * 8,
            base + np.int64(second) * 8,
            np.int64(lanes),
        )
