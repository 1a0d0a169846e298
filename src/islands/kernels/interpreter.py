"""Interpreter of flat programs: one instruction works on a whole row of lanes.

The operands of an instruction are rows of consecutive float64 values, given by their addresses. The cost of
decoding an instruction is therefore shared by the whole row.

No instruction is a reduction, so the processor's vector width cannot change a result.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, multiply, read, sign, subtract, write

#: Instruction ``target = first + second``.
ADD = 0

#: Instruction ``target = first - second``.
SUBTRACT = 1

#: Instruction ``target = first * second``.
MULTIPLY = 2

#: Instruction ``target = sign(first)``.
SIGN = 3

#: Instruction ``target = sign(first - second)``.
SIGN_OF_DIFFERENCE = 4

#: Instruction ``target = sign(first * second)``.
SIGN_OF_PRODUCT = 5

#: Instruction that calls a row function through its address.
CALL = 6

#: Largest number of factors of a term that the kernels multiply without a temporary.
MAX_FACTORS = 4

#: Value of an operand's channel if the operand is a temporary and not a signal.
TEMPORARY = -1


class Program(NamedTuple):
    """Flat three-address program over rows, with the terms that are computed from its operands.

    Attributes
    ----------
    code : ndarray of int64, shape (instructions, 4)
        Operation, target temporary, first operand, second operand.
    addresses : ndarray of int64, shape (instructions,)
        Machine address of the row function of a CALL, otherwise 0.
    operands : ndarray of int64, shape (operands, 2)
        Channel and lag, or `TEMPORARY` and its index. Channel 0 is the output.
    constants : ndarray of float64, shape (constants,)
        Values of the first temporaries.
    parameters : ndarray of int64, shape (constants,)
        Number of the parameter whose value the constant has, from 1; 0 for a number.
    temporaries : int
        Number of temporary rows, including those of the constants.
    factors : ndarray of int64, shape (terms, 4)
        Operands whose product is the term.
    degree : ndarray of int64, shape (terms,)
        Number of factors of the term.
    """

    code: NDArray[np.int64]
    addresses: NDArray[np.int64]
    operands: NDArray[np.int64]
    constants: NDArray[np.float64]
    parameters: NDArray[np.int64]
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


@kernel(forceinline=True, constants=("count", "times"))
def execute(operation, target, first, second, function, count, times):
    """Execute one instruction on rows: ``target = operation(first, second)``.

    ``target``, ``first`` and ``second`` are addresses; ``function`` is the address of the function of a CALL.
    A row consists of ``times * count`` vectors, both constants; ``count`` vectors are processed at a time.
    """
    step, size = 8 * VECTOR * count, 8 * VECTOR * count * times
    if operation == CALL:
        call_row(function, target, first, second, VECTOR * count * times)
    elif operation == MULTIPLY:
        for at in range(0, size, step):
            write(target + at, multiply(read(first + at, count), read(second + at, count)))
    elif operation == SUBTRACT:
        for at in range(0, size, step):
            write(target + at, subtract(read(first + at, count), read(second + at, count)))
    elif operation == SIGN_OF_DIFFERENCE:
        for at in range(0, size, step):
            write(target + at, sign(subtract(read(first + at, count), read(second + at, count))))
    elif operation == SIGN_OF_PRODUCT:
        for at in range(0, size, step):
            write(target + at, sign(multiply(read(first + at, count), read(second + at, count))))
    elif operation == SIGN:
        for at in range(0, size, step):
            write(target + at, sign(read(first + at, count)))
    else:
        for at in range(0, size, step):
            write(target + at, add(read(first + at, count), read(second + at, count)))


@kernel(forceinline=True, constants=("count",))
def multiply_factors(a, b, c, d, degree, count):
    """Return the product, from left to right, of the first ``degree`` of four rows, given as addresses."""
    product = read(a, count)
    if degree > 1:
        product = multiply(product, read(b, count))
        if degree > 2:
            product = multiply(product, read(c, count))
            if degree > 3:
                product = multiply(product, read(d, count))
    return product
