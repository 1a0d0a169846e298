"""Simulation of a linear state space with static units in its feedback.

    x(k+1) = A x(k) + B u(k) + E h(k) + c,    h(k) = f(W [x(k); u(k)] + b)
    y(k)   = C x(k) + D u(k) + F h(k) + d

The parameters are one array: A, B, C, D, E, F, W, b, c, d, each row by row.
"""

import math

import numpy as np

from islands.kernels.jit_cache import kernel

#: Codes of functions. The code of a unit is that of its function, or has several operations, each a digit of
#: base 16. They begin with the lowest digit, and with the argument as the only value.
TANH, SQUARE, CUBE, MAGNITUDE, HINGE, ROOT, DEAD_ZONE, SATURATION, BELL = range(1, 10)

#: Operations that begin a further value with the argument, and that multiply the last two values.
ARGUMENT, PRODUCT, OPERATION_BITS, OPERATION = 10, 11, 4, 15

#: A state with a larger absolute value has diverged.
BOUND = 1e6

#: Least distance from zero at which the slope of the root is evaluated.
LEAST_ROOT = 1e-6


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
        root = math.sqrt(max(abs(s), LEAST_ROOT))
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
def compute_output(theta, n, inputs, signals, h):
    """Return the output of a row; ``signals`` begins with the states and the inputs."""
    _, at_c, _, _, at_f, _, _, _, at_level = place_blocks(n, inputs, h.size)
    y = theta[at_level]
    for j in range(n + inputs):
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
        y[k] = compute_output(theta, n, inputs, signals, h)
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


@kernel
def trace_states(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input]
    x,  # float64 [state]: states at the first row
    traces,  # out, float64 [row, state and unit and unit, 1]: states, units and their slopes
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
        traces[k, :n, 0] = signals[:n]
        traces[k, n : n + units, 0] = h
        traces[k, n + units :, 0] = slope
        if not _advance(theta, n, signals, h, after):
            return k
        signals[:n] = after
    return u.shape[0]
