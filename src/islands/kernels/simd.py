"""The vector type: so many numbers side by side, and what can be done to all of them at once.

``Lanes(count)`` is ``count`` vectors of eight float64. Numba knows no such type; here LLVM's own,
``[count x <8 x double>]``, is made one, with a function for every operation. The compiler turns it into
whatever registers the processor has: eight lanes are one register of AVX-512, two of AVX2, four of SSE2.
Because the eight stand in the source, so does the order of every sum over them, and no result depends on the
processor. Nothing here is contracted into a fused multiply-add, for the same reason.

A count is written as a constant: ``load(arena, offset, 4)``. Offsets count numbers, not bytes; nothing is
checked.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

from islands.kernels.jit_cache import kernel

#: Lanes of one vector.
VECTOR = 8

_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, VECTOR)
_INDEX = ir.IntType(32)


@kernel
def padded_size(size):
    """Return an array of ``size`` numbers that begins where a line of the processor's cache does.

    A vector that lies across two lines costs two reads.
    """
    array = np.empty(size + VECTOR)
    behind = array.ctypes.data // 8 % VECTOR
    begin = (VECTOR - behind) % VECTOR
    return array[begin : begin + size]


class SimdVector(types.Type):
    """``count`` vectors of eight numbers."""

    def __init__(self, count):
        self.count = count
        super().__init__(name=f"Lanes({count})")


@register_model(SimdVector)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, lanes):
        super().__init__(manager, lanes, ir.ArrayType(_VECTOR, lanes.count))


@intrinsic(prefer_literal=True)
def load(_typingctx, array, offset, count):
    """Return ``8 * count`` numbers of a contiguous array, from an offset on."""
    return SimdVector(count.literal_value)(array, types.int64, count), _reading(_in_array)


@intrinsic
def store(_typingctx, array, offset, lanes):
    """Write lanes into a contiguous array, from an offset on."""
    return types.void(array, types.int64, lanes), _writing(_in_array)


@intrinsic
def address(_typingctx, array, offset):
    """Return where a number of an array stands in memory, in bytes.

    Whoever works with addresses keeps the array by its name until the last of them is used.
    """

    def generate(context, builder, signature, arguments):
        return builder.ptrtoint(_in_array(context, builder, signature, arguments), ir.IntType(64))

    return types.int64(array, types.int64), generate


@intrinsic(prefer_literal=True)
def read(_typingctx, place, count):
    """Return ``8 * count`` numbers from an address on."""
    return SimdVector(count.literal_value)(types.int64, count), _reading(_at_address)


@intrinsic
def write(_typingctx, place, lanes):
    """Write lanes from an address on."""
    return types.void(types.int64, lanes), _writing(_at_address)


@intrinsic(prefer_literal=True)
def broadcast(_typingctx, number, count):
    """Return lanes that all hold one number."""

    def generate(_context, builder, signature, arguments):
        vector = _splat(builder, arguments[0])
        return _made(builder, signature.return_type.count, lambda _i: vector)

    return SimdVector(count.literal_value)(types.float64, count), generate


@intrinsic
def add(_typingctx, a, b):
    """Return ``a + b``."""
    return a(a, b), _each(lambda builder, x, y: builder.fadd(x, y))


@intrinsic
def subtract(_typingctx, a, b):
    """Return ``a - b``."""
    return a(a, b), _each(lambda builder, x, y: builder.fsub(x, y))


@intrinsic
def multiply(_typingctx, a, b):
    """Return ``a * b``."""
    return a(a, b), _each(lambda builder, x, y: builder.fmul(x, y))


@intrinsic
def sign(_typingctx, a):
    """Return 1, -1 or 0 (for a NaN, too)."""

    def one(builder, x):
        zero, plus, minus = (ir.Constant(_VECTOR, [value] * VECTOR) for value in (0.0, 1.0, -1.0))
        negative = builder.select(builder.fcmp_ordered("<", x, zero), minus, zero)
        return builder.select(builder.fcmp_ordered(">", x, zero), plus, negative)

    return a(a), _each(one)


@intrinsic
def any_outside(_typingctx, a, bound):
    """Return 0 where every lane lies between ``-bound`` and ``bound``; a NaN does not."""

    def generate(_context, builder, signature, arguments):
        lanes, upper = arguments[0], _splat(builder, arguments[1])
        lower = builder.fneg(upper)
        found = ir.Constant(ir.VectorType(ir.IntType(1), VECTOR), [0] * VECTOR)
        for i in range(signature.args[0].count):
            x = builder.extract_value(lanes, i)
            for one in (builder.fcmp_unordered(">", x, upper), builder.fcmp_unordered("<", x, lower)):
                found = builder.or_(found, one)
        return builder.zext(builder.bitcast(found, ir.IntType(VECTOR)), ir.IntType(64))

    return types.int64(a, types.float64), generate


@intrinsic
def gather(_typingctx, array, a, b, c, d):
    """Return four vectors, eight numbers each from four offsets on."""

    def generate(context, builder, signature, arguments):
        firsts = [_in_array(context, builder, signature, (arguments[0], offset)) for offset in arguments[1:]]
        return _made(builder, 4, lambda i: _read(builder, firsts[i], 0))

    return SimdVector(4)(array, types.int64, types.int64, types.int64, types.int64), generate


@intrinsic
def repeat(_typingctx, a):
    """Return four times the same vector."""

    def generate(_context, builder, _signature, arguments):
        return _made(builder, 4, lambda _i: builder.extract_value(arguments[0], 0))

    return SimdVector(4)(a), generate


@intrinsic
def outer(_typingctx, a, b):
    """Return the products of four vectors with four others, the first with all, the second with all, ..."""
    return SimdVector(16)(a, b), _products([(i, j) for i in range(4) for j in range(4)])


@intrinsic
def outer_upper(_typingctx, a):
    """Return the products of four vectors among themselves: each with itself and those behind it."""
    return SimdVector(10)(a), _products([(i, j) for i in range(4) for j in range(i, 4)])


def _products(places):
    def generate(_context, builder, _signature, arguments):
        one, other = arguments[0], arguments[-1]
        return _made(
            builder,
            len(places),
            lambda k: builder.fmul(
                builder.extract_value(one, places[k][0]), builder.extract_value(other, places[k][1])
            ),
        )

    return generate


@intrinsic
def fold(_typingctx, a):
    """Return the sum of the eight lanes of one vector: the second half is added to the first, and again."""

    def generate(_context, builder, _signature, arguments):
        vector = builder.extract_value(arguments[0], 0)
        numbers = [builder.extract_element(vector, ir.Constant(_INDEX, i)) for i in range(VECTOR)]
        while len(numbers) > 1:
            middle = len(numbers) // 2
            numbers = [builder.fadd(numbers[i], numbers[i + middle]) for i in range(middle)]
        return numbers[0]

    return types.float64(a), generate


def _each(operation):
    """Return the code of an operation that treats every vector alike."""

    def generate(_context, builder, signature, arguments):
        return _made(
            builder,
            signature.return_type.count,
            lambda i: operation(builder, *(builder.extract_value(argument, i) for argument in arguments)),
        )

    return generate


def _made(builder, count, vector):
    lanes = ir.Constant(ir.ArrayType(_VECTOR, count), ir.Undefined)
    for i in range(count):
        lanes = builder.insert_value(lanes, vector(i), i)
    return lanes


def _reading(first):
    """Return the code that reads lanes; ``first`` points at their first number."""

    def generate(context, builder, signature, arguments):
        begin = first(context, builder, signature, arguments)
        return _made(builder, signature.return_type.count, lambda i: _read(builder, begin, i))

    return generate


def _writing(first):
    """Return the code that writes lanes, the last argument."""

    def generate(context, builder, signature, arguments):
        begin = first(context, builder, signature, arguments)
        for i in range(signature.args[-1].count):
            _align(builder.store(builder.extract_value(arguments[-1], i), _vector_at(builder, begin, i)))
        return context.get_dummy_value()

    return generate


def _in_array(context, builder, signature, arguments):
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]])


def _at_address(_context, builder, _signature, arguments):
    return builder.inttoptr(arguments[0], _DOUBLE.as_pointer())


def _vector_at(builder, first, i):
    place = builder.gep(first, [ir.Constant(_INDEX, VECTOR * i)])
    return builder.bitcast(place, _VECTOR.as_pointer())


def _read(builder, first, i):
    return _align(builder.load(_vector_at(builder, first, i)))


def _align(instruction):
    # Rows begin where they begin: numbers are aligned, vectors need not be.
    instruction.align = 8
    return instruction


def _splat(builder, number):
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, number, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(_INDEX, VECTOR), [0] * VECTOR))
