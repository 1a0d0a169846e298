"""The row machine: what one instruction of a flat program does to a row of lanes.

A program never touches single numbers. Its operands are rows of ``lanes`` consecutive float64 of one flat
arena, so the cost of decoding an instruction is shared by the whole row and the inner loops vectorise. All
offsets are unsigned: a signed one makes the compiler guard every access against negative indices, which
keeps the loop from vectorising.

Nothing here is a reduction, so the processor's vector width cannot change a result.
"""

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

#: Instructions built into the machine; every other one calls a row function through its address.
ADD, SUBTRACT, MULTIPLY, SIGN, CALL = 0, 1, 2, 3, 4

#: The largest number of factors that one term multiplies on the fly.
MAX_FACTORS = 4

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

    ``target``, ``first`` and ``second`` are the rows' offsets in the arena and ``lanes`` their length (uint64).
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
