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
from islands.kernels.summation import CHUNK

#: Codes of the functions of the units.
TANH, SQUARE, CUBE, MAGNITUDE, HINGE, ROOT, DEAD_ZONE, SATURATION, BELL = range(9)

#: A state with a larger absolute value has diverged.
BOUND = 1e6

#: Least distance from zero at which the slope of the root is evaluated.
_LEAST_ROOT = 1e-6


@kernel(forceinline=True)
def evaluate_unit(code, s):
    """Return the value of the function of a unit and its slope."""
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
def _place(n, inputs, units):
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
    _, at_c, _, _, at_f, _, _, _, at_level = _place(n, signals.size - n, h.size)
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
    at_b, _, _, at_e, _, _, _, at_drift, _ = _place(n, inputs, units)
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
    _, _, _, _, _, at_w, at_bias, _, _ = _place(n, inputs, units)
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
    _, _, _, _, _, at_w, at_bias, _, _ = _place(n, inputs, units)
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
def _add(slopes, at, place, value):
    """Add a value to the derivative with respect to a parameter, if it is free."""
    if place >= 0:
        slopes[at + place] += value


@kernel(forceinline=True)
def _multiply_rows(matrix, rows, columns, slopes, width, out):
    """Multiply the derivatives of the states, vectors of ``width`` parameters, by a matrix."""
    for p in range(0, width, VECTOR):
        for i in range(rows):
            total = broadcast(0.0, 1)
            for j in range(columns):
                total = add(total, multiply(broadcast(matrix[i, j], 1), load(slopes, j * width + p, 1)))
            store(out, i * width + p, total)


@kernel(forceinline=True)
def _differentiate_output(theta, places, n, signals, h, slope, states, width, gain, out):
    """Write the derivatives of the output at one row."""
    units, inputs = h.size, signals.size - n
    _, at_c, _, _, at_f, at_w, at_bias, _, at_level = _place(n, inputs, units)
    for j in range(n):
        found = theta[at_c + j]
        for unit in range(units):
            found += theta[at_f + unit] * slope[unit] * theta[at_w + unit * signals.size + j]
        gain[0, j] = found
    _multiply_rows(gain, 1, n, states, width, out)
    _add(out, 0, places[at_level], 1.0)
    for j in range(signals.size):
        _add(out, 0, places[at_c + j], signals[j])
    for unit in range(units):
        _add(out, 0, places[at_f + unit], h[unit])
        factor = theta[at_f + unit] * slope[unit]
        _add(out, 0, places[at_bias + unit], factor)
        for j in range(signals.size):
            _add(out, 0, places[at_w + unit * signals.size + j], factor * signals[j])


@kernel(forceinline=True)
def _differentiate_states(theta, places, n, signals, h, slope, states, width, jacobian, out):
    """Write the derivatives of the states at the next row."""
    units, inputs = h.size, signals.size - n
    at_b, _, _, at_e, _, at_w, at_bias, at_drift, _ = _place(n, inputs, units)
    for i in range(n):
        for j in range(n):
            total = theta[i * n + j]
            for unit in range(units):
                total += theta[at_e + i * units + unit] * slope[unit] * theta[at_w + unit * signals.size + j]
            jacobian[i, j] = total
    _multiply_rows(jacobian, n, n, states, width, out)
    for i in range(n):
        at = i * width
        _add(out, at, places[at_drift + i], 1.0)
        for j in range(n):
            _add(out, at, places[i * n + j], signals[j])
        for j in range(inputs):
            _add(out, at, places[at_b + i * inputs + j], signals[n + j])
        for unit in range(units):
            _add(out, at, places[at_e + i * units + unit], h[unit])
            factor = theta[at_e + i * units + unit] * slope[unit]
            if factor != 0.0:
                _add(out, at, places[at_bias + unit], factor)
                for j in range(signals.size):
                    _add(out, at, places[at_w + unit * signals.size + j], factor * signals[j])


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
):
    """Compute the inner products of all derivatives and of the error ``y - simulation``, which is last.

    Return the number of rows before a divergence.
    """
    n, units = x.size, codes.size
    _, _, _, _, _, at_w, at_bias, _, _ = _place(n, u.shape[1], units)
    free = columns + n
    width = -(-free // VECTOR) * VECTOR
    now, later = padded_size(n * width), padded_size(n * width)
    now[:] = 0.0
    for i in range(n):
        now[i * width + columns + i] = 1.0
    slopes, after = padded_size(width), np.empty(n)
    jacobian, gain = np.empty((n, n)), np.empty((1, n))
    signals, h, slope = np.empty(n + u.shape[1]), np.empty(units), np.empty(units)
    signals[:n] = x
    blocks = -(-(free + 1) // 4)
    tiles = blocks * (blocks + 1) // 2
    chunk, running = padded_size(4 * blocks * CHUNK), padded_size(16 * VECTOR * tiles)
    chunk[:], running[:] = 0.0, 0.0
    filled = 0
    for k in range(u.shape[0]):
        signals[n:] = u[k]
        _evaluate_units(theta, at_w, at_bias, codes, signals, h, slope)
        error = y[k] - _compute_output(theta, n, signals, h)
        if not (math.isnan(y[k]) or (y[k] >= upper and error < 0.0) or (y[k] <= lower and error > 0.0)):
            _differentiate_output(theta, places, n, signals, h, slope, now, width, gain, slopes)
            for p in range(free):
                chunk[p * CHUNK + filled] = slopes[p]
            chunk[free * CHUNK + filled] = error
            filled += 1
            if filled == CHUNK:
                add_tiles(chunk, blocks, 0, tiles, running)
                filled = 0
        if not _advance(theta, n, signals, h, after):
            return k
        _differentiate_states(theta, places, n, signals, h, slope, now, width, jacobian, later)
        signals[:n] = after
        now, later = later, now
    for p in range(free + 1):
        chunk[p * CHUNK + filled : (p + 1) * CHUNK] = 0.0
    add_tiles(chunk, blocks, 0, tiles, running)
    read_tiles(running, blocks, 0, tiles, free + 1, out)
    return u.shape[0]
