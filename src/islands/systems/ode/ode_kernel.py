"""Kernel that interprets the instructions of a system and integrates it by RK4, eight lanes at a time.

A row is eight consecutive values, one for each lane; a lane is one set of parameters and initial states. No
instruction combines lanes, so that no lane depends on another one, nor on the vector width of the processor.
"""

import math

import numpy as np

from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SUBTRACT
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, broadcast, multiply, read, sign, subtract, write
from islands.kernels.simd_functions import (
    absolute,
    divide,
    negate,
    select_less,
    select_less_equal,
    square_root,
)
from islands.systems.mechanics import WIDTH, call_law

# Instructions of `islands.kernels.interpreter` keep their numbers. All others are functions here and not
# calls of addresses, which would be compiled once per process.

DIVIDE = 10
COPY = 11
NEGATE = 12
ABSOLUTE = 13
SQUARE_ROOT = 14
MINIMUM = 15
MAXIMUM = 16
LESS = 17
LESS_EQUAL = 18
#: Instruction ``target = second if first > 0 else third``.
SELECT = 19
#: Instructions ``target = first + second*third`` and ``first - second*third``, with both roundings.
ADD_PRODUCT = 20
SUBTRACT_PRODUCT = 21

# Functions of the C library, lane by lane.
POWER = 30
EXPONENTIAL = 31
LOGARITHM = 32
SINE = 33
COSINE = 34
TANGENT = 35
HYPERBOLIC_TANGENT = 36
ARC_TANGENT = 37

#: Instruction that sums the force laws; the operands are the coordinate and its rate.
FORCES = 40

#: Samples between two checks whether a lane is still finite.
_CHECK = 16

#: Bytes of a row.
_ROW = 8 * VECTOR


@kernel(forceinline=True)
def _execute(operation, base, target, first, second, third):
    """Execute an instruction on rows of an arena at the address ``base``."""
    to, a, b, c = base + _ROW * target, base + _ROW * first, base + _ROW * second, base + _ROW * third
    if operation == MULTIPLY:
        write(to, multiply(read(a, 1), read(b, 1)))
    elif operation == ADD:
        write(to, add(read(a, 1), read(b, 1)))
    elif operation == SUBTRACT:
        write(to, subtract(read(a, 1), read(b, 1)))
    elif operation == ADD_PRODUCT:
        write(to, add(read(a, 1), multiply(read(b, 1), read(c, 1))))
    elif operation == SUBTRACT_PRODUCT:
        write(to, subtract(read(a, 1), multiply(read(b, 1), read(c, 1))))
    elif operation == DIVIDE:
        write(to, divide(read(a, 1), read(b, 1)))
    elif operation == COPY:
        write(to, read(a, 1))
    elif operation == SIGN:
        write(to, sign(read(a, 1)))
    elif operation == SQUARE_ROOT:
        write(to, square_root(read(a, 1)))
    elif operation == ABSOLUTE:
        write(to, absolute(read(a, 1)))
    elif operation == NEGATE:
        write(to, negate(read(a, 1)))
    elif operation == MINIMUM:
        write(to, select_less(read(a, 1), read(b, 1), read(a, 1), read(b, 1)))
    elif operation == MAXIMUM:
        write(to, select_less(read(b, 1), read(a, 1), read(a, 1), read(b, 1)))
    elif operation == LESS:
        write(to, select_less(read(a, 1), read(b, 1), broadcast(1.0, 1), broadcast(0.0, 1)))
    elif operation == LESS_EQUAL:
        write(to, select_less_equal(read(a, 1), read(b, 1), broadcast(1.0, 1), broadcast(0.0, 1)))
    else:
        write(to, select_less(broadcast(0.0, 1), read(a, 1), read(b, 1), read(c, 1)))


@kernel(forceinline=True)
def _apply(operation, arena, target, first, second, lanes):
    """Apply a function to the first ``lanes`` lanes of rows."""
    for lane in range(lanes):
        x, b = arena[VECTOR * first + lane], arena[VECTOR * second + lane]
        if operation == POWER:
            y = x**b
        elif operation == EXPONENTIAL:
            y = math.exp(x)
        elif operation == LOGARITHM:
            y = np.log(x)
        elif operation == SINE:
            y = math.sin(x)
        elif operation == COSINE:
            y = math.cos(x)
        elif operation == TANGENT:
            y = math.tan(x)
        elif operation == HYPERBOLIC_TANGENT:
            y = math.tanh(x)
        else:
            y = math.atan(x)
        arena[VECTOR * target + lane] = y


@kernel
def _sum_forces(arena, laws, states, slopes, target, coordinate, rate, lanes):
    """Write the sum of the force laws, and the derivatives of their states."""
    own = states + slopes.size - laws.forces.size
    for lane in range(lanes):
        x, v, total = arena[VECTOR * coordinate + lane], arena[VECTOR * rate + lane], 0.0
        for e in range(laws.forces.size):
            numbers = laws.numbers.ctypes.data + 8 * WIDTH * (VECTOR * e + lane)
            z = arena[VECTOR * (own + e) + lane]
            total += call_law(laws.forces[e], x, v, z, numbers)
            slope = 0.0
            if laws.state_derivatives[e] != 0:
                slope = call_law(laws.state_derivatives[e], x, v, z, numbers)
            arena[VECTOR * slopes[slopes.size - laws.forces.size + e] + lane] = slope
        arena[VECTOR * target + lane] = total


@kernel(forceinline=True)
def execute_code(instructions, begin, end, base, arena, laws, lanes):
    """Execute the instructions from ``begin`` to ``end`` on an arena at the address ``base``."""
    code, states, slopes = instructions.code, instructions.states, instructions.slopes
    for i in range(begin, end):
        operation = code[i, 0]
        if operation < POWER:
            _execute(operation, base, code[i, 1], code[i, 2], code[i, 3], code[i, 4])
        elif operation < FORCES:
            _apply(operation, arena, code[i, 1], code[i, 2], code[i, 3], lanes)
        else:
            _sum_forces(arena, laws, states, slopes, code[i, 1], code[i, 2], code[i, 3], lanes)


@kernel(forceinline=True)
def _advance(stage, dt, slope, before, total, state):
    """Finish a stage for one state: write its value at the next stage, or at the next sample.

    ``slope`` is the derivative; ``before``, ``total`` and ``state`` are the addresses of the state at the
    sample, of the sum of the derivatives, and of the state itself.
    """
    if stage == 3:
        new = add(read(before, 1), multiply(broadcast(dt / 6.0, 1), add(read(total, 1), slope)))
        write(before, new)
        write(state, new)
        return
    if stage == 0:
        write(total, slope)
    else:
        write(total, add(read(total, 1), multiply(broadcast(2.0, 1), slope)))
    part = dt if stage == 2 else 0.5 * dt
    write(state, add(read(before, 1), multiply(broadcast(part, 1), slope)))


@kernel
def _limit(arena, states, before, lower, upper, receivers, caught):
    """Limit the states at a sample; a NaN remains. Receivers get a part of what upper limits cut off."""
    for i in range(caught.size):
        if before[i] > upper[i]:
            before[VECTOR * receivers[i // VECTOR] + i % VECTOR] += caught[i] * (before[i] - upper[i])
    for i in range(lower.size):
        x = before[i]
        if x < lower[i]:
            x = lower[i]
        elif x > upper[i]:
            x = upper[i]
        before[i] = x
        arena[VECTOR * states + i] = x


@kernel
def _is_finite(before, lane):
    return np.isfinite(before[lane::VECTOR]).all()


@kernel
def integrate(instructions, arena, shared, own, dt, limits, restarts, laws, lanes, out):
    """Integrate a system from the states in the arena; write the outputs.

    ``arena`` (rows*8,) contains constants, parameters and initial states. ``shared`` (samples, 3, signals)
    are signals that are equal in all lanes, at the start, in the middle and at the end of each step; ``own``
    (samples, 3, signals, 8) the others, which follow them. ``out`` is (samples, outputs, 8); only the first
    ``lanes`` lanes are computed. All outputs of a lane that diverges are NaN.
    """
    ends, states = instructions.ends, instructions.states
    signals, slopes, outputs = instructions.signals, instructions.slopes, instructions.outputs
    size = slopes.size * VECTOR
    before, total = arena[VECTOR * states : VECTOR * states + size].copy(), np.empty(size)
    base = arena.ctypes.data
    restart = 0
    for k in range(out.shape[0]):
        if restart < restarts.samples.size and restarts.samples[restart] == k:
            for i in range(restarts.states.shape[1]):
                before[i] = restarts.states[restart, i]
                arena[VECTOR * states + i] = before[i]
            restart += 1
        for stage in range(4):
            begin, end = ends[0], ends[3] if stage == 0 else ends[2]
            if stage == 2:
                begin = ends[1]  # the signals are those of the stage before
            else:
                moment = (stage + 1) // 2
                for s in range(shared.shape[2]):
                    write(base + _ROW * signals[s], broadcast(shared[k, moment, s], 1))
                for s in range(own.shape[2]):
                    for lane in range(lanes):
                        arena[VECTOR * signals[shared.shape[2] + s] + lane] = own[k, moment, s, lane]
            if k == 0 and stage == 0:
                begin = 0
            execute_code(instructions, begin, end, base, arena, laws, lanes)
            if stage == 0:
                for output in range(outputs.size):
                    for lane in range(lanes):
                        out[k, output, lane] = arena[VECTOR * outputs[output] + lane]
                if k + 1 == out.shape[0]:
                    break
            for i in range(slopes.size):
                slope = read(base + _ROW * slopes[i], 1)
                places = before.ctypes.data + _ROW * i, total.ctypes.data + _ROW * i
                _advance(stage, dt, slope, *places, base + _ROW * (states + i))
        if limits.lower.size > 0:
            _limit(arena, states, before, limits.lower, limits.upper, limits.receivers, limits.caught)
        if k % _CHECK == 0:
            alive = False
            for lane in range(lanes):
                alive |= _is_finite(before, lane)
            if not alive:
                break
    for lane in range(lanes):
        if not _is_finite(before, lane):
            out[:, :, lane] = np.nan
