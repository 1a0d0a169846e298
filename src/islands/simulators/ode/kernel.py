"""Kernel that interprets the instructions of a system and integrates it by RK4, sixteen lanes at a time.

A row is sixteen consecutive values, one for each lane; a lane is one set of parameters and initial states. No
instruction combines lanes, so that no lane depends on another one, nor on the vector width of the processor.
"""

import math

import numpy as np

from islands.kernels.interpreter import ADD, MULTIPLY, SIGN, SUBTRACT
from islands.kernels.jit_cache import kernel
from islands.kernels.mechanics import WIDTH, call_law
from islands.kernels.simd import add, broadcast, multiply, read, sign, subtract, write
from islands.kernels.simd_functions import (
    absolute,
    divide,
    negate,
    select_less,
    select_less_equal,
    square_root,
)
from islands.simulators.ode.kernel_arguments import LANES, VECTORS

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
TANGENT = 33
ARC_TANGENT = 34

#: Instruction that sums the force laws; the operands are the coordinate and its rate.
FORCES = 40

#: Samples between two checks whether a lane is still finite.
_CHECK = 16

#: Bytes of a row.
_ROW = 8 * LANES


@kernel(forceinline=True)
def _read(place):
    return read(place, VECTORS)


@kernel(forceinline=True)
def _fill(number):
    return broadcast(number, VECTORS)


@kernel(forceinline=True)
def _execute(operation, base, target, first, second, third):
    """Execute an instruction on rows of an arena at the address ``base``."""
    to, a, b, c = base + _ROW * target, base + _ROW * first, base + _ROW * second, base + _ROW * third
    if operation == MULTIPLY:
        write(to, multiply(_read(a), _read(b)))
    elif operation == ADD:
        write(to, add(_read(a), _read(b)))
    elif operation == SUBTRACT:
        write(to, subtract(_read(a), _read(b)))
    elif operation == ADD_PRODUCT:
        write(to, add(_read(a), multiply(_read(b), _read(c))))
    elif operation == SUBTRACT_PRODUCT:
        write(to, subtract(_read(a), multiply(_read(b), _read(c))))
    elif operation == DIVIDE:
        write(to, divide(_read(a), _read(b)))
    elif operation == COPY:
        write(to, _read(a))
    elif operation == SIGN:
        write(to, sign(_read(a)))
    elif operation == SQUARE_ROOT:
        write(to, square_root(_read(a)))
    elif operation == ABSOLUTE:
        write(to, absolute(_read(a)))
    elif operation == NEGATE:
        write(to, negate(_read(a)))
    elif operation == MINIMUM:
        write(to, select_less(_read(a), _read(b), _read(a), _read(b)))
    elif operation == MAXIMUM:
        write(to, select_less(_read(b), _read(a), _read(a), _read(b)))
    elif operation == LESS:
        write(to, select_less(_read(a), _read(b), _fill(1.0), _fill(0.0)))
    elif operation == LESS_EQUAL:
        write(to, select_less_equal(_read(a), _read(b), _fill(1.0), _fill(0.0)))
    else:
        write(to, select_less(_fill(0.0), _read(a), _read(b), _read(c)))


@kernel(forceinline=True)
def _apply(operation, arena, target, first, second, lanes):
    """Apply a function to the first ``lanes`` lanes of rows."""
    for lane in range(lanes):
        x, b = arena[LANES * first + lane], arena[LANES * second + lane]
        if operation == POWER:
            y = x**b
        elif operation == EXPONENTIAL:
            y = math.exp(x)
        elif operation == LOGARITHM:
            y = np.log(x)
        elif operation == TANGENT:
            y = math.tan(x)
        else:
            y = math.atan(x)
        arena[LANES * target + lane] = y


@kernel
def _sum_forces(arena, laws, states, slopes, target, coordinate, rate, lanes):
    """Write the sum of the force laws, and the derivatives of their states."""
    own = states + slopes.size - laws.forces.size
    for lane in range(lanes):
        x, v, total = arena[LANES * coordinate + lane], arena[LANES * rate + lane], 0.0
        for e in range(laws.forces.size):
            numbers = laws.numbers.ctypes.data + 8 * WIDTH * (LANES * e + lane)
            z = arena[LANES * (own + e) + lane]
            total += call_law(laws.forces[e], x, v, z, numbers)
            slope = 0.0
            if laws.state_derivatives[e] != 0:
                slope = call_law(laws.state_derivatives[e], x, v, z, numbers)
            arena[LANES * slopes[slopes.size - laws.forces.size + e] + lane] = slope
        arena[LANES * target + lane] = total


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
        new = add(_read(before), multiply(_fill(dt / 6.0), add(_read(total), slope)))
        write(before, new)
        write(state, new)
        return
    if stage == 0:
        write(total, slope)
    else:
        write(total, add(_read(total), multiply(_fill(2.0), slope)))
    part = dt if stage == 2 else 0.5 * dt
    write(state, add(_read(before), multiply(_fill(part), slope)))


@kernel
def _limit(arena, states, before, lower, upper, receivers, caught):
    """Limit the states at a sample; a NaN remains. Receivers get a part of what upper limits cut off."""
    for i in range(caught.size):
        if before[i] > upper[i]:
            before[LANES * receivers[i // LANES] + i % LANES] += caught[i] * (before[i] - upper[i])
    for i in range(lower.size):
        x = before[i]
        if x < lower[i]:
            x = lower[i]
        elif x > upper[i]:
            x = upper[i]
        before[i] = x
        arena[LANES * states + i] = x


@kernel
def _is_finite(before, lane):
    """Return whether all states of a lane are finite."""
    finite = True
    for i in range(lane, before.size, LANES):
        finite &= math.isfinite(before[i])
    return finite


@kernel
def _is_any_finite(before, lanes):
    """Return whether the states of any lane are finite."""
    finite = False
    for lane in range(lanes):
        finite |= _is_finite(before, lane)
    return finite


@kernel(forceinline=True)
def _write_signals(arena, base, rows, shared, own, width, places, k, own_sample, moment, lanes):
    """Write the signals at a moment of a step; each lane has its own ``places`` among ``width`` values."""
    for s in range(shared.shape[2]):
        write(base + _ROW * rows[s], _fill(shared[k, moment, s]))
    first = (3 * own_sample + moment) * width
    for s in range(places.shape[0]):
        row = LANES * rows[shared.shape[2] + s]
        for lane in range(lanes):
            arena[row + lane] = own[first + places[s, lane]]


@kernel(forceinline=True)
def _write_outputs(base, outputs, sample, first, out):
    """Write the outputs of sixteen lanes from ``first``."""
    for output in range(outputs.size):
        place = (sample * outputs.size + output) * out.shape[2] + first
        write(out.ctypes.data + 8 * place, _read(base + _ROW * outputs[output]))


@kernel
def _mark_diverged(before, lanes, first, out):
    """Replace all outputs of the lanes that have diverged by NaN."""
    for lane in range(lanes):
        if not _is_finite(before, lane):
            out[:, :, first + lane] = np.nan


@kernel
def integrate(instructions, arena, signals, dt, limits, restarts, laws, lanes, first, every, out):
    """Integrate a system from the states in the arena; write the outputs.

    ``arena`` (rows*16,) contains constants, parameters and initial states. ``out`` is (samples, outputs, all
    lanes) and receives the first of ``every`` successive samples. The kernel computes ``lanes`` lanes, and
    overwrites the values of 16, from ``first``. Without restarts, all outputs of a lane that diverges are
    NaN.
    """
    ends, states = instructions.ends, instructions.states
    rows, slopes, outputs = instructions.signals, instructions.slopes, instructions.outputs
    base, size = arena.ctypes.data, slopes.size * LANES
    before, total = arena[LANES * states : LANES * states + size].copy(), np.empty(size)
    shared, own, width, places = signals.shared, signals.own.reshape(-1), signals.own.shape[2], signals.places
    samples, restart, start, block = shared.shape[0], 0, 0, 0
    for k in range(samples):
        if restart < restarts.samples.size and restarts.samples[restart] == k:
            for i in range(restarts.states.shape[1]):
                before[i] = restarts.states[restart, i]
                arena[LANES * states + i] = before[i]
            if places.shape[0] > 1:
                start, block = k, restart
            restart += 1
        for stage in range(4):
            is_read = stage == 0 and k % every == 0
            begin, end = ends[0], ends[3] if is_read else ends[2]
            if stage == 2:
                begin = ends[1]  # the signals are those of the stage before
            else:
                moment = (stage + 1) // 2
                _write_signals(
                    arena, base, rows, shared, own, width, places[block], k, k - start, moment, lanes
                )
            if k == 0 and stage == 0:
                begin = 0
            execute_code(instructions, begin, end, base, arena, laws, lanes)
            if is_read:
                _write_outputs(base, outputs, k // every, first, out)
            if k + 1 == samples:
                break
            for i in range(slopes.size):
                slope = _read(base + _ROW * slopes[i])
                addresses = before.ctypes.data + _ROW * i, total.ctypes.data + _ROW * i
                _advance(stage, dt, slope, *addresses, base + _ROW * (states + i))
        if limits.lower.size > 0:
            _limit(arena, states, before, limits.lower, limits.upper, limits.receivers, limits.caught)
        # A restart makes the states of a lane finite again.
        if restarts.samples.size == 0 and k % _CHECK == 0 and not _is_any_finite(before, lanes):
            break
    if restarts.samples.size == 0:
        _mark_diverged(before, lanes, first, out)
