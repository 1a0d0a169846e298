"""Force elements, and their forces along a given motion."""

from functools import cache
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from islands.kernels.jit_cache import compile_callback, kernel

#: Maximum size of the numbers of an element: its values, followed by its constants.
WIDTH = 8

#: Arguments: coordinate, its rate, the element's state, pointer to the element's numbers.
_SIGNATURE = types.float64(types.float64, types.float64, types.float64, types.CPointer(types.float64))


class Elements(NamedTuple):
    """Force elements that act on one coordinate.

    Attributes
    ----------
    forces : ndarray of int64, shape (elements,)
        Machine addresses of ``force(x, rate, z, numbers)``.
    state_derivatives : ndarray of int64, shape (elements,)
        Machine addresses of ``z' = state_derivative(x, rate, z, numbers)``. 0 for elements without state.
    signs : ndarray, shape (elements,)
        Factors of the forces.
    initial_states : ndarray, shape (elements,)
        States at the first sample.
    numbers : ndarray, shape (elements, WIDTH)
        Values and constants of the elements.
    """

    forces: NDArray[np.int64]
    state_derivatives: NDArray[np.int64]
    signs: NDArray[np.float64]
    initial_states: NDArray[np.float64]
    numbers: NDArray[np.float64]


@cache
def compile_law(function):
    """Compile a scalar function of an element; `Elements` stores its ``address``."""
    return compile_callback(function, _SIGNATURE)


@intrinsic
def call_law(_typingctx, address, x, rate, z, numbers):
    """Call ``double (double, double, double, double *)`` at a machine address."""

    def generate(_context, builder, _signature, arguments):
        double = ir.DoubleType()
        prototype = ir.FunctionType(double, [double, double, double, double.as_pointer()])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        at = builder.inttoptr(arguments[4], double.as_pointer())
        return builder.call(function, [*arguments[1:4], at])

    return types.float64(types.int64, types.float64, types.float64, types.float64, types.int64), generate


@kernel
def integrate_along(x, rate, dt, elements, found):
    """Write the force of each element along a given motion into ``found`` (elements, samples).

    The states are integrated by RK4 with a linearly interpolated coordinate.
    """
    for e in range(elements.forces.size):
        numbers = elements.numbers.ctypes.data + 8 * WIDTH * e
        force, derivative, sign = elements.forces[e], elements.state_derivatives[e], elements.signs[e]
        z = elements.initial_states[e]
        for k in range(x.size):
            found[e, k] = sign * call_law(force, x[k], rate[k], z, numbers)
            if derivative != 0 and k + 1 < x.size:
                half, v = 0.5 * (x[k] + x[k + 1]), (x[k + 1] - x[k]) / dt
                first = call_law(derivative, x[k], v, z, numbers)
                second = call_law(derivative, half, v, z + 0.5 * dt * first, numbers)
                third = call_law(derivative, half, v, z + 0.5 * dt * second, numbers)
                fourth = call_law(derivative, x[k + 1], v, z + dt * third, numbers)
                z += dt / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
