"""Free runs of a state space with units over several segments of a record at once, and their squared errors.

Each segment is a lane of the vectors: one row of eight segments takes about as long as one row of a segment.
The formulas are those of `islands.kernels.state_space`. The exponential, and with it tanh and the bell,
differs by rounding.
"""

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import (
    VECTOR,
    add,
    any_outside,
    broadcast,
    load,
    multiply,
    padded_size,
    sign,
    store,
    subtract,
)
from islands.kernels.simd_functions import (
    absolute,
    clip,
    divide,
    exponential,
    hyperbolic_tangent,
    negate,
    select_less,
    select_less_equal,
    square_root,
)
from islands.kernels.state_space import (
    ARGUMENT,
    BOUND,
    CUBE,
    DEAD_ZONE,
    HINGE,
    LEAST_ROOT,
    MAGNITUDE,
    OPERATION,
    OPERATION_BITS,
    PRODUCT,
    ROOT,
    SATURATION,
    SQUARE,
    TANH,
    place_blocks,
)


@kernel(forceinline=True)
def _evaluate_function(code, s):
    """Return a function of one vector, and its slope."""
    zero, one, two = broadcast(0.0, 1), broadcast(1.0, 1), broadcast(2.0, 1)
    if code == TANH:
        value = hyperbolic_tangent(s)
        return value, subtract(one, multiply(value, value))
    if code == SQUARE:
        return multiply(s, s), multiply(two, s)
    if code == CUBE:
        square = multiply(s, s)
        return multiply(square, s), multiply(broadcast(3.0, 1), square)
    if code == MAGNITUDE:
        return absolute(s), sign(s)
    if code == HINGE:
        return select_less(zero, s, s, zero), select_less(zero, s, one, zero)
    if code == ROOT:
        size, least = absolute(s), broadcast(LEAST_ROOT, 1)
        root = square_root(select_less(size, least, least, size))
        return multiply(sign(s), square_root(size)), divide(broadcast(0.5, 1), root)
    if code == DEAD_ZONE:
        return subtract(s, clip(s, 1.0)), select_less(absolute(s), one, zero, one)
    if code == SATURATION:
        return clip(s, 1.0), select_less(absolute(s), one, one, zero)
    value = exponential(negate(multiply(s, s)))
    return value, multiply(multiply(negate(two), s), value)


@kernel(forceinline=True)
def _evaluate(code, s):
    """Return a unit of one vector, and its slope."""
    if code <= OPERATION:
        return _evaluate_function(code, s)
    value, second, third = s, s, s
    slope = broadcast(1.0, 1)
    second_slope, third_slope = slope, slope
    while code:
        operation = code & OPERATION
        code >>= OPERATION_BITS
        if operation == ARGUMENT:
            value, second, third = s, value, second
            slope, second_slope, third_slope = broadcast(1.0, 1), slope, second_slope
        elif operation == PRODUCT:
            slope = add(multiply(slope, second), multiply(value, second_slope))
            value, second = multiply(value, second), third
            second_slope = third_slope
        else:
            value, factor = _evaluate_function(operation, value)
            slope = multiply(slope, factor)
    return value, slope


@kernel(forceinline=True)
def _add_products(total, theta, at, values, first, count, step):
    """Return a vector plus the products of ``count`` parameters with as many vectors."""
    for j in range(count):
        total = add(total, multiply(broadcast(theta[at + j], 1), load(values, first + j * step, 1)))
    return total


@kernel(forceinline=True)
def _weigh(error, measured, lower, upper):
    """Return the error of each lane: zero without an output, and for a simulation beyond a measured limit."""
    zero = broadcast(0.0, 1)
    known = select_less_equal(measured, measured, error, zero)
    above = select_less_equal(broadcast(upper, 1), measured, select_less(known, zero, zero, known), known)
    return select_less_equal(measured, broadcast(lower, 1), select_less(zero, above, zero, above), above)


@kernel(forceinline=True)
def _reset_ended(x, group, row, rows):
    """Set the states of the ended segments of a group to zero; return whether all others are bounded."""
    for lane in range(group, group + VECTOR):
        if row >= rows[lane]:
            for i in range(x.shape[0]):
                x[i, lane] = 0.0
        else:
            for i in range(x.shape[0]):
                if not abs(x[i, lane]) <= BOUND:
                    return False
    return True


@kernel
def sum_squared_errors(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input, lane]: zero after the end of a segment
    y,  # float64 [row, lane]: measured; NaN is left out, also after the end of a segment
    rows,  # int64 [lane]: number of rows of each segment
    lower,  # limits of the sensor
    upper,
    x,  # float64 [state, lane]: states at the first row; those after the last one afterwards
    total,  # out, float64 [lane]: sum of the squared errors
):
    """Simulate all segments; return whether all are bounded. The number of lanes is a multiple of eight."""
    n, inputs, lanes, units = x.shape[0], u.shape[1], y.shape[1], codes.size
    at_b, at_c, at_d, at_e, at_f, at_w, at_bias, at_drift, at_level = place_blocks(n, inputs, units)
    width = n + inputs
    h, after = padded_size(max(1, units) * VECTOR), padded_size(n * VECTOR)
    total[:] = 0.0
    for row in range(y.shape[0]):
        for group in range(0, lanes, VECTOR):
            read = row * inputs * lanes + group
            for unit in range(units):
                s = broadcast(theta[at_bias + unit], 1)
                s = _add_products(s, theta, at_w + unit * width, x, group, n, lanes)
                s = _add_products(s, theta, at_w + unit * width + n, u, read, inputs, lanes)
                store(h, unit * VECTOR, _evaluate(codes[unit], s)[0])
            simulated = broadcast(theta[at_level], 1)
            simulated = _add_products(simulated, theta, at_c, x, group, n, lanes)
            simulated = _add_products(simulated, theta, at_d, u, read, inputs, lanes)
            simulated = _add_products(simulated, theta, at_f, h, 0, units, VECTOR)
            measured = load(y, row * lanes + group, 1)
            error = _weigh(subtract(measured, simulated), measured, lower, upper)
            store(total, group, add(load(total, group, 1), multiply(error, error)))
            outside = 0
            for i in range(n):
                found = broadcast(theta[at_drift + i], 1)
                found = _add_products(found, theta, i * n, x, group, n, lanes)
                found = _add_products(found, theta, at_b + i * inputs, u, read, inputs, lanes)
                found = _add_products(found, theta, at_e + i * units, h, 0, units, VECTOR)
                store(after, i * VECTOR, found)
                outside |= any_outside(found, BOUND)
            for i in range(n):
                store(x, i * lanes + group, load(after, i * VECTOR, 1))
            if outside and not _reset_ended(x, group, row, rows):
                return False
    return True


@kernel
def trace_lanes(
    theta,
    codes,  # int64 [unit]
    u,  # float64 [row, input, lane]: zero after the end of a segment
    rows,  # int64 [lane]: number of rows of each segment
    x,  # float64 [state, lane]: states at the first row; replaced
    traces,  # out, float64 [row, state and unit and unit, lane]: states, units and their slopes
):
    """Simulate all segments; return whether all are bounded. The number of lanes is a multiple of eight."""
    n, inputs, lanes, units = x.shape[0], u.shape[1], x.shape[1], codes.size
    at_b, _, _, at_e, _, at_w, at_bias, at_drift, _ = place_blocks(n, inputs, units)
    width, items = n + inputs, traces.shape[1]
    for row in range(u.shape[0]):
        for group in range(0, lanes, VECTOR):
            read, at = row * inputs * lanes + group, row * items * lanes + group
            for i in range(n):
                store(traces, at + i * lanes, load(x, i * lanes + group, 1))
            for unit in range(units):
                s = broadcast(theta[at_bias + unit], 1)
                s = _add_products(s, theta, at_w + unit * width, traces, at, n, lanes)
                s = _add_products(s, theta, at_w + unit * width + n, u, read, inputs, lanes)
                value, slope = _evaluate(codes[unit], s)
                store(traces, at + (n + unit) * lanes, value)
                store(traces, at + (n + units + unit) * lanes, slope)
            outside = 0
            for i in range(n):
                found = broadcast(theta[at_drift + i], 1)
                found = _add_products(found, theta, i * n, traces, at, n, lanes)
                found = _add_products(found, theta, at_b + i * inputs, u, read, inputs, lanes)
                found = _add_products(found, theta, at_e + i * units, traces, at + n * lanes, units, lanes)
                store(x, i * lanes + group, found)
                outside |= any_outside(found, BOUND)
            if outside and not _reset_ended(x, group, row, rows):
                return False
    return True
