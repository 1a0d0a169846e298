"""What moves: elements that resist a coordinate, along a given motion or within a balance of forces."""

from functools import cache
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: Numbers that an element may have: its values, and behind them its constants.
WIDTH = 8

#: The coordinate, its rate, the element's own state, its numbers.
_SIGNATURE = types.float64(types.float64, types.float64, types.float64, types.CPointer(types.float64))


class Elements(NamedTuple):
    """Elements that act on one coordinate.

    Attributes
    ----------
    forces : ndarray of int64, shape (elements,)
        Machine addresses of ``force(x, rate, z, numbers)``.
    memories : ndarray of int64, shape (elements,)
        Those of ``z' = memory(x, rate, z, numbers)``; 0 where there is no state.
    signs : ndarray, shape (elements,)
        With which each force counts.
    begins : ndarray, shape (elements,)
        Their states at the first sample.
    numbers : ndarray, shape (elements, WIDTH)
    """

    forces: NDArray[np.int64]
    memories: NDArray[np.int64]
    signs: NDArray[np.float64]
    begins: NDArray[np.float64]
    numbers: NDArray[np.float64]


@cache
def compiled(function):
    """Compile a plain scalar function of an element; its ``address`` is what `Elements` take."""
    return cfunc(_SIGNATURE, error_model="numpy")(function)


@intrinsic
def _call(_typingctx, address, x, rate, z, numbers):
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
    """Add up what elements do along a motion that is given; write ``total`` (samples,).

    Their states see the coordinate run straight from sample to sample.
    """
    total[:] = 0.0
    for e in range(elements.forces.size):
        numbers = elements.numbers.ctypes.data + 8 * WIDTH * e
        force, memory, sign = elements.forces[e], elements.memories[e], elements.signs[e]
        z = elements.begins[e]
        for k in range(x.size):
            total[k] += sign * _call(force, x[k], rate[k], z, numbers)
            if memory != 0 and k + 1 < x.size:
                half, v = 0.5 * (x[k] + x[k + 1]), (x[k + 1] - x[k]) / dt
                first = _call(memory, x[k], v, z, numbers)
                second = _call(memory, half, v, z + 0.5 * dt * first, numbers)
                third = _call(memory, half, v, z + 0.5 * dt * second, numbers)
                fourth = _call(memory, x[k + 1], v, z + dt * third, numbers)
                z += dt / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


@kernel
def _slopes(state, drive, mass, damping, stiffness, elements, slope):
    """Write the rate of change of ``state``: coordinate, rate, and every element's own."""
    force = drive - damping * state[1] - stiffness * state[0]
    for e in range(elements.forces.size):
        numbers = elements.numbers.ctypes.data + 8 * WIDTH * e
        force += elements.signs[e] * _call(elements.forces[e], state[0], state[1], state[2 + e], numbers)
        if elements.memories[e] != 0:
            slope[2 + e] = _call(elements.memories[e], state[0], state[1], state[2 + e], numbers)
        else:
            slope[2 + e] = 0.0
    slope[0] = state[1]
    slope[1] = force / mass


@kernel
def integrate_motion(u, midway, dt, mass, damping, stiffness, elements, begins, x0, v0, x):
    """Integrate ``m x'' + c x' + k x = u + forces`` by RK4, a step a sample; write ``x`` (samples,).

    ``midway`` (2, samples) is the input half a step and nearly a whole one behind each sample: it may jump at
    the next one. Where ``begins`` is set the motion starts anew from ``x0`` and ``v0``; elements keep their
    states.
    """
    size = 2 + elements.forces.size
    state, at = np.zeros(size), np.empty(size)
    state[2:] = elements.begins
    first, second, third, fourth = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for k in range(u.size):
        if begins[k]:
            state[0], state[1] = x0[k], v0[k]
        x[k] = state[0]
        if not np.isfinite(state[0]):
            x[k:] = np.nan
            return
        if k + 1 == u.size:
            return
        half, end = midway[0, k], midway[1, k]
        _slopes(state, u[k], mass, damping, stiffness, elements, first)
        for i in range(size):
            at[i] = state[i] + 0.5 * dt * first[i]
        _slopes(at, half, mass, damping, stiffness, elements, second)
        for i in range(size):
            at[i] = state[i] + 0.5 * dt * second[i]
        _slopes(at, half, mass, damping, stiffness, elements, third)
        for i in range(size):
            at[i] = state[i] + dt * third[i]
        _slopes(at, end, mass, damping, stiffness, elements, fourth)
        for i in range(size):
            state[i] += dt / 6.0 * (first[i] + 2.0 * second[i] + 2.0 * third[i] + fourth[i])
