"""A kernel has one version for calls by kernels, and one for each value of its constants."""

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import broadcast, fold


@kernel
def scale(x, factor):
    return x * factor


@kernel(constants=("count",))
def add_lanes(x, count):
    return fold(broadcast(x, count)) if count == 1 else 0.0 * x


def call_with_literals(x, number):
    return scale(x, 2) + scale(x, 3) + scale(factor=number, x=x)


def call_with_constants(x):
    return add_lanes(x, 1) + add_lanes(x, count=2)


def compiled(function):
    """Compile a function; a kernel could have been stored, and would compile no callee."""
    from numba import njit

    return njit(function)


def test_each_value_of_a_constant_has_its_version():
    assert compiled(call_with_constants)(1.5) == 8 * 1.5
    assert len(add_lanes.callee.overloads) == 2


def test_python_and_kernels_call_one_kernel():
    assert scale(1.5, 4) == 6.0
    assert compiled(call_with_literals)(1.5, 4) == 1.5 * (2 + 3 + 4)
