"""Kernels for mechanical systems with force elements, along a given motion or in a balance of forces."""

from functools import cache
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

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
    return cfunc(_SIGNATURE, error_model="numpy")(function)


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
def integrate_along(x, rate, dt, elements, total):
    """Sum the forces of the elements along a given motion; write ``total`` (samples,).

    The states are integrated by RK4 with a linearly interpolated coordinate.
    """
    total[:] = 0.0
    for e in range(elements.forces.size):
        numbers = elements.numbers.ctypes.data + 8 * WIDTH * e
        force, derivative, sign = elements.forces[e], elements.state_derivatives[e], elements.signs[e]
        z = elements.initial_states[e]
        for k in range(x.size):
            total[k] += sign * call_law(force, x[k], rate[k], z, numbers)
            if derivative != 0 and k + 1 < x.size:
                half, v = 0.5 * (x[k] + x[k + 1]), (x[k + 1] - x[k]) / dt
                first = call_law(derivative, x[k], v, z, numbers)
                second = call_law(derivative, half, v, z + 0.5 * dt * first, numbers)
                third = call_law(derivative, half, v, z + 0.5 * dt * second, numbers)
                fourth = call_law(derivative, x[k + 1], v, z + dt * third, numbers)
                z += dt / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


@kernel
def _state_derivative(state, drive, mass, damping, stiffness, elements, slope):
    """Write the derivative of ``state``: coordinate, rate, and the states of the elements."""
    force = drive - damping * state[1] - stiffness * state[0]
    for e in range(elements.forces.size):
        numbers = elements.numbers.ctypes.data + 8 * WIDTH * e
        force += elements.signs[e] * call_law(elements.forces[e], state[0], state[1], state[2 + e], numbers)
        if elements.state_derivatives[e] != 0:
            slope[2 + e] = call_law(elements.state_derivatives[e], state[0], state[1], state[2 + e], numbers)
        else:
            slope[2 + e] = 0.0
    slope[0] = state[1]
    slope[1] = force / mass


@kernel
def integrate_motion(u, intersample, dt, mass, damping, stiffness, elements, restarts, x0, v0, x):
    """Integrate ``m x'' + c x' + k x = u + forces`` by RK4, one step per sample; write ``x`` (samples,).

    ``intersample`` (2, samples) is the input half a step after each sample, and at the end of the step just
    before the next sample, where the input may jump. At samples with ``restarts`` set, the motion restarts
    from ``x0`` and ``v0``; the elements keep their states. ``x`` is NaN from the sample at which the motion
    is not finite.
    """
    size = 2 + elements.forces.size
    state, at = np.zeros(size), np.empty(size)
    state[2:] = elements.initial_states
    first, second, third, fourth = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for k in range(u.size):
        if restarts[k]:
            state[0], state[1] = x0[k], v0[k]
        x[k] = state[0]
        if not np.isfinite(state[0]):
            x[k:] = np.nan
            return
        if k + 1 == u.size:
            return
        half, end = intersample[0, k], intersample[1, k]
        _state_derivative(state, u[k], mass, damping, stiffness, elements, first)
        for i in range(size):
            at[i] = state[i] + 0.5 * dt * first[i]
        _state_derivative(at, half, mass, damping, stiffness, elements, second)
        for i in range(size):
            at[i] = state[i] + 0.5 * dt * second[i]
        _state_derivative(at, half, mass, damping, stiffness, elements, third)
        for i in range(size):
            at[i] = state[i] + dt * third[i]
        _state_derivative(at, end, mass, damping, stiffness, elements, fourth)
        for i in range(size):
            state[i] += dt / 6.0 * (first[i] + 2.0 * second[i] + 2.0 * third[i] + fourth[i])
