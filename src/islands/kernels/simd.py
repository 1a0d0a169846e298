"""SIMD vector type for Numba, with its operations.

``SimdVector(count)`` is ``count`` vectors of eight float64 values. Numba has no such type; this module wraps
LLVM's ``[count x <8 x double>]`` and defines one function per operation. The compiler maps it to the
registers of the processor: eight lanes are one register of AVX-512, two of AVX2, four of SSE2. The source
fixes the number of lanes and with it the order of every sum over them, so no result depends on the processor.
For the same reason no operation is contracted into a fused multiply-add; where the source asks for one, as
``multiply_add``, its single rounding is that of every processor.

A count is a constant: ``load(arena, offset, 4)``. Offsets are in values, not in bytes. There are no bounds
checks.
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
    """Return an array of ``size`` values that starts at a cache line of the processor.

    A vector that crosses two cache lines costs two reads.
    """
    array = np.empty(size + VECTOR)
    behind = array.ctypes.data // 8 % VECTOR
    begin = (VECTOR - behind) % VECTOR
    return array[begin : begin + size]


class SimdVector(types.Type):
    """Numba type of ``count`` vectors of eight values."""

    def __init__(self, count):
        self.count = count
        super().__init__(name=f"SimdVector({count})")


@register_model(SimdVector)
class _SimdVectorModel(models.PrimitiveModel):
    def __init__(self, manager, lanes):
        super().__init__(manager, lanes, ir.ArrayType(_VECTOR, lanes.count))


@intrinsic(prefer_literal=True)
def load(_typingctx, array, offset, count):
    """Read ``8 * count`` values of a contiguous array, starting at an offset."""
    return SimdVector(count.literal_value)(array, types.int64, count), _generate_read(_pointer_in_array)


@intrinsic
def store(_typingctx, array, offset, lanes):
    """Write a vector into a contiguous array, starting at an offset."""
    return types.void(array, types.int64, lanes), _generate_write(_pointer_in_array)


@intrinsic
def address(_typingctx, array, offset):
    """Return the address in memory, in bytes, of a value of an array.

    The caller must keep a reference to the array until the last use of the address.
    """

    def generate(context, builder, signature, arguments):
        return builder.ptrtoint(_pointer_in_array(context, builder, signature, arguments), ir.IntType(64))

    return types.int64(array, types.int64), generate


@intrinsic(prefer_literal=True)
def read(_typingctx, place, count):
    """Read ``8 * count`` values, starting at an address."""
    return SimdVector(count.literal_value)(types.int64, count), _generate_read(_pointer_to_address)


@intrinsic
def write(_typingctx, place, lanes):
    """Write a vector, starting at an address."""
    return types.void(types.int64, lanes), _generate_write(_pointer_to_address)


@intrinsic(prefer_literal=True)
def broadcast(_typingctx, number, count):
    """Return a vector with the same value in every lane."""

    def generate(_context, builder, signature, arguments):
        vector = _broadcast(builder, arguments[0])
        return _build(builder, signature.return_type.count, lambda _i: vector)

    return SimdVector(count.literal_value)(types.float64, count), generate


@intrinsic(prefer_literal=True)
def spread(_typingctx, array, offset, count):
    """Return a vector with the value of an array at an offset in every lane."""

    def generate(context, builder, signature, arguments):
        number = builder.load(_pointer_in_array(context, builder, signature, arguments))
        vector = _broadcast(builder, number)
        return _build(builder, signature.return_type.count, lambda _i: vector)

    return SimdVector(count.literal_value)(array, types.int64, count), generate


@intrinsic
def add(_typingctx, a, b):
    """Return ``a + b``."""
    return a(a, b), elementwise(lambda builder, x, y: builder.fadd(x, y))


@intrinsic
def subtract(_typingctx, a, b):
    """Return ``a - b``."""
    return a(a, b), elementwise(lambda builder, x, y: builder.fsub(x, y))


@intrinsic
def multiply(_typingctx, a, b):
    """Return ``a * b``."""
    return a(a, b), elementwise(lambda builder, x, y: builder.fmul(x, y))


@intrinsic
def multiply_add(_typingctx, a, b, c):
    """Return ``a * b + c``, rounded once: one operation of a processor with AVX2, a slow call on others."""
    return a(a, b, c), elementwise(_fuse)


@intrinsic
def sign(_typingctx, a):
    """Return 1, -1 or 0 per lane; 0 for a NaN."""

    def one(builder, x):
        zero, plus, minus = (ir.Constant(_VECTOR, [value] * VECTOR) for value in (0.0, 1.0, -1.0))
        negative = builder.select(builder.fcmp_ordered("<", x, zero), minus, zero)
        return builder.select(builder.fcmp_ordered(">", x, zero), plus, negative)

    return a(a), elementwise(one)


@intrinsic
def any_outside(_typingctx, a, bound):
    """Return 0 if every lane is between ``-bound`` and ``bound``; a NaN is outside."""

    def generate(_context, builder, signature, arguments):
        lanes, upper = arguments[0], _broadcast(builder, arguments[1])
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
    """Return four vectors: eight values starting at each of four offsets."""

    def generate(context, builder, signature, arguments):
        firsts = [
            _pointer_in_array(context, builder, signature, (arguments[0], offset)) for offset in arguments[1:]
        ]
        return _build(builder, 4, lambda i: _load_vector(builder, firsts[i], 0))

    return SimdVector(4)(array, types.int64, types.int64, types.int64, types.int64), generate


@intrinsic
def repeat(_typingctx, a):
    """Return one vector repeated four times."""

    def generate(_context, builder, _signature, arguments):
        return _build(builder, 4, lambda _i: builder.extract_value(arguments[0], 0))

    return SimdVector(4)(a), generate


@intrinsic
def outer(_typingctx, a, b):
    """Return the products of four vectors with four others: the first with all, the second with all, ..."""
    return SimdVector(16)(a, b), _generate_products([(i, j) for i in range(4) for j in range(4)])


@intrinsic
def outer_upper(_typingctx, a):
    """Return the products of four vectors with each other: each with itself and with those after it."""
    return SimdVector(10)(a), _generate_products([(i, j) for i in range(4) for j in range(i, 4)])


@intrinsic
def add_outer(_typingctx, sums, a, b):
    """Return the sums of 16 vectors and of the products of `outer`, each rounded once."""
    return sums(sums, a, b), _generate_sums([(i, j) for i in range(4) for j in range(4)])


@intrinsic
def add_outer_upper(_typingctx, sums, a):
    """Return the sums of ten vectors and of the products of `outer_upper`, each rounded once."""
    return sums(sums, a), _generate_sums([(i, j) for i in range(4) for j in range(i, 4)])


def _generate_sums(places):
    def generate(_context, builder, _signature, arguments):
        sums, one, other = arguments[0], arguments[1], arguments[-1]
        return _build(
            builder,
            len(places),
            lambda k: _fuse(
                builder,
                builder.extract_value(one, places[k][0]),
                builder.extract_value(other, places[k][1]),
                builder.extract_value(sums, k),
            ),
        )

    return generate


def _fuse(builder, a, b, c):
    name = f"llvm.fma.v{VECTOR}f64"
    function = builder.module.globals.get(name)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * 3), name)
    return builder.call(function, [a, b, c])


def _generate_products(places):
    def generate(_context, builder, _signature, arguments):
        one, other = arguments[0], arguments[-1]
        return _build(
            builder,
            len(places),
            lambda k: builder.fmul(
                builder.extract_value(one, places[k][0]), builder.extract_value(other, places[k][1])
            ),
        )

    return generate


@intrinsic
def fold(_typingctx, a):
    """Return the sum of the eight lanes of one vector: the second half is added to the first, repeatedly."""

    def generate(_context, builder, _signature, arguments):
        vector = builder.extract_value(arguments[0], 0)
        numbers = [builder.extract_element(vector, ir.Constant(_INDEX, i)) for i in range(VECTOR)]
        while len(numbers) > 1:
            middle = len(numbers) // 2
            numbers = [builder.fadd(numbers[i], numbers[i + middle]) for i in range(middle)]
        return numbers[0]

    return types.float64(a), generate


def elementwise(operation):
    """Return the code generator of an operation that is applied to every vector."""

    def generate(_context, builder, signature, arguments):
        return _build(
            builder,
            signature.return_type.count,
            lambda i: operation(builder, *(builder.extract_value(argument, i) for argument in arguments)),
        )

    return generate


def _build(builder, count, vector):
    lanes = ir.Constant(ir.ArrayType(_VECTOR, count), ir.Undefined)
    for i in range(count):
        lanes = builder.insert_value(lanes, vector(i), i)
    return lanes


def _generate_read(first):
    """Return the code generator of a read; ``first`` generates the pointer to the first value."""

    def generate(context, builder, signature, arguments):
        begin = first(context, builder, signature, arguments)
        return _build(builder, signature.return_type.count, lambda i: _load_vector(builder, begin, i))

    return generate


def _generate_write(first):
    """Return the code generator of a write; the vector is the last argument."""

    def generate(context, builder, signature, arguments):
        begin = first(context, builder, signature, arguments)
        for i in range(signature.args[-1].count):
            _set_alignment(
                builder.store(builder.extract_value(arguments[-1], i), _vector_pointer(builder, begin, i))
            )
        return context.get_dummy_value()

    return generate


def _pointer_in_array(context, builder, signature, arguments):
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]])


def _pointer_to_address(_context, builder, _signature, arguments):
    return builder.inttoptr(arguments[0], _DOUBLE.as_pointer())


def _vector_pointer(builder, first, i):
    place = builder.gep(first, [ir.Constant(_INDEX, VECTOR * i)])
    return builder.bitcast(place, _VECTOR.as_pointer())


def _load_vector(builder, first, i):
    return _set_alignment(builder.load(_vector_pointer(builder, first, i)))


def _set_alignment(instruction):
    # A row may start at any value: values are aligned to 8 bytes, vectors need not be aligned.
    instruction.align = 8
    return instruction


def _broadcast(builder, number):
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, number, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(_INDEX, VECTOR), [0] * VECTOR))
