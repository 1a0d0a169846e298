"""Simulation of a linear state space with static units in its feedback, and its exact derivatives.

    x(k+1) = A x(k) + B u(k) + E h(k) + c,    h(k) = f(W [x(k); u(k)] + b)
    y(k)   = C x(k) + D u(k) + F h(k) + d

The parameters are one array: A, B, C, D, E, F, W, b, c, d, each row by row. The derivatives of the states
with respect to all free parameters are propagated together, in vectors of parameters (forward sensitivities).
"""

import math

import numpy as np

from islands.kernels.gram import add_tiles, read_tiles
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, broadcast, load, multiply, padded_size, store
from islands.kernels.simd_functions import absolute, select_less
from islands.kernels.summation import CHUNK

#: Codes of functions. The code of a unit is that of its function, or has several operations, each a digit of
#: base 16. They begin with the lowest digit, and with the argument as the only value.
TANH, SQUARE, CUBE, MAGNITUDE, HINGE, ROOT, DEAD_ZONE, SATURATION, BELL = range(1, 10)

#: Operations that begin a further value with the argument, and that multiply the last two values.
ARGUMENT, PRODUCT, OPERATION_BITS, OPERATION = 10, 11, 4, 15

#: A state with a larger absolute value has diverged.
BOUND = 1e6

#: No derivatives of single rows are written.
NO_DERIVATIVES = np.empty((0, 0))

#: Derivatives up to this magnitude are zero, and the rows after which they are compared with it.
_TINY, _FLUSHED_ROWS = 1e-140, 32

#: Least distance from zero at which the slope of the root is evaluated.
_LEAST_ROOT = 1e-6


@kernel(forceinline=True)
def _evaluate_function(code, s):
    """Return the value of a function and its slope."""
    if code == TANH:
        value = math.tanh(s)
        return value, 1.0 - value * value
    if code == SQUARE:
        return s * s, 2.0 * s
    if code == CUBE:
        return s * s * s, 3.0 * s * s
    if code == MAGNITUDE:
        return abs(s), np.sign(s)
    if code == HINGE:
        return max(s, 0.0), 1.0 if s > 0.0 else 0.0
    if code == ROOT:
        root = math.sqrt(max(abs(s), _LEAST_ROOT))
        return np.sign(s) * math.sqrt(abs(s)), 0.5 / root
    if code == DEAD_ZONE:
        return s - min(max(s, -1.0), 1.0), 0.0 if abs(s) < 1.0 else 1.0
    if code == SATURATION:
        return min(max(s, -1.0), 1.0), 1.0 if abs(s) < 1.0 else 0.0
    value = math.exp(-s * s)
    return value, -2.0 * s * value


@kernel(forceinline=True)
def evaluate_unit(code, s):
    """Return the value of a unit and its slope."""
    if code <= OPERATION:
        return _evaluate_function(code, s)
    value, slope = s, 1.0
    second, second_slope, third, third_slope = 0.0, 0.0, 0.0, 0.0
    while code:
        operation = code & OPERATION
        code >>= OPERATION_BITS
        if operation == ARGUMENT:
            third, third_slope = second, second_slope
            second, second_slope = value, slope
            value, slope = s, 1.0
        elif operation == PRODUCT:
            slope = slope * second + value * second_slope
            value *= second
            second, second_slope = third, third_slope
        else:
            value, factor = _evaluate_function(operation, value)
            slope *= factor
    return value, slope


@kernel(forceinline=True)
def place_blocks(n, inputs, units):
    """Return the positions of B, C, D, E, F, W, b, c and d."""
    at_c = n * (n + inputs)
    at_e = at_c + n + inputs
    at_f = at_e + n * units
    at_w = at_f + units
    at_bias = at_w + units * (n + inputs)
    return n * n, at_c, at_c + n, at_e, at_f, at_w, at_bias, at_bias + units, at_bias + units + n


@kernel(forceinline=True)
def _evaluate_units(theta, at_w, at_b, codes, signals, h, slope):
    """Write the values and the slopes of all units for the states and inputs ``signals``."""
    width = signals.size
    for unit in range(codes.size):
        s = theta[at_b + unit]
        for j in range(width):
            s += theta[at_w + unit * width + j] * signals[j]
        h[unit], slope[unit] = evaluate_unit(codes[unit], s)


@kernel(forceinline=True)
def _compute_output(theta, n, signals, h):
    """Return the output of a row."""
    _, at_c, _, _, at_f, _, _, _, at_level = place_blocks(n, signals.size - n, h.size)
    y = theta[at_level]
    for j in range(signals.size):
        y += theta[at_c + j] * signals[j]
    for unit in range(h.size):
        y += theta[at_f + unit] * h[unit]
    return y


@kernel(forceinline=True)
def _advance(theta, n, signals, h, after):
    """Write the states at the next row; return whether they are bounded."""
    units, inputs = h.size, signals.size - n
    at_b, _, _, at_e, _, _, _, at_drift, _ = place_blocks(n, inputs, units)
    for i in range(n):
        found = theta[at_drift + i]
        for j in range(n):
            found += theta[i * n + j] * signals[j]
        for j in range(inputs):
            found += theta[at_b + i * inputs + j] * signals[n + j]
        for unit in range(units):
            found += theta[at_e + i * units + unit] * h[unit]
        after[i] = found
        if not abs(found) <= BOUND:
            return False
    return True


@kernel
def simulate_state_space(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input]
    x,  # float64 [state]: states at the first row; replaced by those after the last one
    y,  # out, float64 [row]
):
    """Simulate the rows; return the number of rows before a divergence."""
    n, inputs, units = x.size, u.shape[1], codes.size
    _, _, _, _, _, at_w, at_bias, _, _ = place_blocks(n, inputs, units)
    signals, after = np.empty(n + inputs), np.empty(n)
    h, slope = np.empty(units), np.empty(units)
    signals[:n] = x
    for k in range(u.shape[0]):
        signals[n:] = u[k]
        _evaluate_units(theta, at_w, at_bias, codes, signals, h, slope)
        y[k] = _compute_output(theta, n, signals, h)
        if not _advance(theta, n, signals, h, after):
            return k
        signals[:n] = after
    x[:] = signals[:n]
    return u.shape[0]


@kernel
def simulate_states(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input]
    x,  # float64 [state]: states at the first row
    states,  # out, float64 [row, state]
):
    """Simulate the states at the rows; return the number of rows before a divergence."""
    n, inputs, units = x.size, u.shape[1], codes.size
    _, _, _, _, _, at_w, at_bias, _, _ = place_blocks(n, inputs, units)
    signals, after = np.empty(n + inputs), np.empty(n)
    h, slope = np.empty(units), np.empty(units)
    signals[:n] = x
    for k in range(u.shape[0]):
        signals[n:] = u[k]
        states[k] = signals[:n]
        _evaluate_units(theta, at_w, at_bias, codes, signals, h, slope)
        if not _advance(theta, n, signals, h, after):
            return k
        signals[:n] = after
    return u.shape[0]


@kernel(forceinline=True)
def _put(values, at, place, value):
    """Write the value of a parameter, if it is free."""
    if place >= 0:
        values[at + place] = value


@kernel(forceinline=True)
def _multiply(matrix, rows, n, states, width, effects, of_units, direct, out, begin):
    """Write the derivatives of ``rows`` signals, vectors of ``width`` parameters.

    They are the derivatives of the states times a matrix, those of the units times their effects, and the
    direct ones.
    """
    wide = width - width % (4 * VECTOR)
    for i in range(rows):
        at = i * width
        for p in range(0, wide, 4 * VECTOR):
            total = add(load(direct, at + p, 4), multiply(load(effects, at + p, 4), load(of_units, p, 4)))
            for j in range(n):
                total = add(total, multiply(broadcast(matrix[i * n + j], 4), load(states, j * width + p, 4)))
            store(out, begin + at + p, total)
        for p in range(wide, width, VECTOR):
            last = add(load(direct, at + p, 1), multiply(load(effects, at + p, 1), load(of_units, p, 1)))
            for j in range(n):
                last = add(last, multiply(broadcast(matrix[i * n + j], 1), load(states, j * width + p, 1)))
            store(out, begin + at + p, last)


@kernel(forceinline=True)
def _write_direct(places, n, signals, h, slope, width, products, matrix, of_units, direct):
    """Write the slopes at one row: ``matrix`` with respect to the states, the others to the parameters.

    The slopes with respect to the states are those of the linear part and of all units.
    """
    inputs, units, size = signals.size - n, h.size, matrix.size
    at_b, at_c, at_d, at_e, at_f, at_w, at_bias, _, _ = place_blocks(n, inputs, units)
    for p in range(0, size, VECTOR):
        total = load(products, p, 1)
        for unit in range(units):
            total = add(total, multiply(broadcast(slope[unit], 1), load(products, (unit + 1) * size + p, 1)))
        store(matrix, p, total)
    for unit in range(units):
        _put(of_units, 0, places[at_bias + unit], slope[unit])
        for j in range(n + inputs):
            _put(of_units, 0, places[at_w + unit * (n + inputs) + j], slope[unit] * signals[j])
    for i in range(n + 1):
        at_states, at_inputs = (at_c, at_d) if i == n else (i * n, at_b + i * inputs)
        effects = at_f if i == n else at_e + i * units
        for j in range(n):
            _put(direct, i * width, places[at_states + j], signals[j])
        for j in range(inputs):
            _put(direct, i * width, places[at_inputs + j], signals[n + j])
        for unit in range(units):
            _put(direct, i * width, places[effects + unit], h[unit])


@kernel
def _prepare(theta, places, n, inputs, units, width, size, products, effects, direct):
    """Write what does not depend on the row; all arrays have rows for the states and one for the output.

    ``products`` has the slopes of the linear part with respect to the states, and behind them the products
    of effect and weights of each unit; ``effects`` has the effects of the unit of each weight and offset, and
    ``direct`` the derivatives with respect to the constants.
    """
    _, at_c, _, at_e, at_f, at_w, at_bias, at_drift, at_level = place_blocks(n, inputs, units)
    products[:], effects[:], direct[:] = 0.0, 0.0, 0.0
    for i in range(n + 1):
        linear = at_c if i == n else i * n
        at = at_f if i == n else at_e + i * units
        _put(direct, i * width, places[at_level if i == n else at_drift + i], 1.0)
        for j in range(n):
            products[i * n + j] = theta[linear + j]
        for unit in range(units):
            _put(effects, i * width, places[at_bias + unit], theta[at + unit])
            for j in range(n + inputs):
                weight = at_w + unit * (n + inputs) + j
                _put(effects, i * width, places[weight], theta[at + unit])
                if j < n:
                    products[(unit + 1) * size + i * n + j] = theta[at + unit] * theta[weight]


@kernel(forceinline=True)
def _flush(values):
    """Replace tiny derivatives by zero.

    The derivatives with respect to the initial states decay, as do those of a unit that is not active. An
    operation on subnormal numbers, which their products are first, takes a hundred times as long.
    """
    tiny, zero = broadcast(_TINY, 1), broadcast(0.0, 1)
    for p in range(0, values.size, VECTOR):
        one = load(values, p, 1)
        store(values, p, select_less(absolute(one), tiny, zero, one))


@kernel(forceinline=True)
def _fill_chunk(staged, count, width, columns, filled, chunk):
    """Write the columns of ``count`` rows into a chunk, whose columns are contiguous."""
    for p in range(columns):
        for row in range(count):
            chunk[p * CHUNK + filled + row] = staged[row * width + p]


@kernel
def accumulate_products(
    theta,
    places,  # int64 [parameter]: column of each parameter; -1 if it is fixed
    codes,
    u,
    x,
    y,  # float64 [row]: measured; NaN is left out
    lower,  # limits of the sensor: a measured limit is no error of a simulation beyond it
    upper,
    columns,  # number of free parameters; the states at the first row have the columns after them
    out,  # out, float64 [columns + states + 1, columns + states + 1]
    derivatives,  # out, float64 [columns + states + 1, row]: those of each row; of no columns, not written
):
    """Compute the inner products of all derivatives and of the error ``y - simulation``, which is last.

    Rows without an error have no derivatives. Return the number of rows before a divergence.
    """
    n, inputs, units = x.size, u.shape[1], codes.size
    _, _, _, _, _, at_w, at_bias, _, _ = place_blocks(n, inputs, units)
    free = columns + n
    width = -(-(free + 1) // VECTOR) * VECTOR
    size = -(-(n + 1) * n // VECTOR) * VECTOR
    products, matrix = padded_size((units + 1) * size), padded_size(size)
    effects, direct = padded_size((n + 1) * width), padded_size((n + 1) * width)
    _prepare(theta, places, n, inputs, units, width, size, products, effects, direct)
    now, later = padded_size(n * width), padded_size(n * width)
    now[:] = 0.0
    for i in range(n):
        now[i * width + columns + i] = 1.0
    of_units, staged = padded_size(width), padded_size(VECTOR * width)
    of_units[:] = 0.0
    signals, h, slope, after = np.empty(n + inputs), np.empty(units), np.empty(units), np.empty(n)
    signals[:n] = x
    blocks = -(-(free + 1) // 4)
    tiles = blocks * (blocks + 1) // 2
    chunk, running = padded_size(4 * blocks * CHUNK), padded_size(16 * VECTOR * tiles)
    chunk[:], running[:] = 0.0, 0.0
    filled = waiting = 0
    for k in range(u.shape[0]):
        if k % _FLUSHED_ROWS == 0:
            _flush(now)
        signals[n:] = u[k]
        _evaluate_units(theta, at_w, at_bias, codes, signals, h, slope)
        error = y[k] - _compute_output(theta, n, signals, h)
        _write_direct(places, n, signals, h, slope, width, products, matrix, of_units, direct)
        if not (math.isnan(y[k]) or (y[k] >= upper and error < 0.0) or (y[k] <= lower and error > 0.0)):
            row = matrix[n * n :], effects[n * width :], direct[n * width :]
            _multiply(row[0], 1, n, now, width, row[1], of_units, row[2], staged, waiting * width)
            staged[waiting * width + free] = error
            for p in range(derivatives.shape[0]):
                derivatives[p, k] = staged[waiting * width + p]
            waiting += 1
            if waiting == VECTOR:
                _fill_chunk(staged, waiting, width, free + 1, filled, chunk)
                filled, waiting = filled + VECTOR, 0
            if filled == CHUNK:
                add_tiles(chunk, blocks, 0, tiles, running)
                filled = 0
        if not _advance(theta, n, signals, h, after):
            return k
        _multiply(matrix, n, n, now, width, effects, of_units, direct, later, 0)
        signals[:n] = after
        now, later = later, now
    _fill_chunk(staged, waiting, width, free + 1, filled, chunk)
    for p in range(free + 1):
        chunk[p * CHUNK + filled + waiting : (p + 1) * CHUNK] = 0.0
    add_tiles(chunk, blocks, 0, tiles, running)
    read_tiles(running, blocks, 0, tiles, free + 1, out)
    return u.shape[0]
