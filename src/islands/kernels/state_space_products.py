"""Inner products of the derivatives of the free run of a state space with units.

The derivatives of the states with respect to all free parameters are propagated together, in vectors of
parameters (forward sensitivities). That of a state at the next row is the sum of those of all states times
the slopes of the system, and of a direct one: a constant of the parameter times a signal of the row. The
derivatives of eight rows are computed before those of the next parameters, so that they remain in the cache.
"""

import math

import numpy as np

from islands.kernels.gram import read_tiles
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import (
    VECTOR,
    add_outer,
    add_outer_upper,
    broadcast,
    gather,
    load,
    multiply,
    multiply_add,
    padded_size,
    spread,
    store,
)
from islands.kernels.simd_functions import absolute, select_less
from islands.kernels.state_space import compute_output, place_blocks
from islands.kernels.summation import CHUNK

#: No derivatives of single rows are written.
NO_DERIVATIVES = np.empty((0, 0))

#: Derivatives up to this magnitude are zero, and the rows after which they are compared with it.
_TINY, _FLUSHED_ROWS = 1e-140, 32


@kernel(forceinline=True)
def _name(sources, factors, width, place, source, state, factor):
    """Write the signal of a parameter, if it is free, and its factor in the equation of a state."""
    if place >= 0:
        sources[place] = source
        factors[state * width + place] = factor


@kernel
def _prepare(theta, places, n, inputs, units, width, size, sources, factors, slopes):
    """Write what does not depend on the row; the output is an equation after those of the states.

    ``sources`` has the signal of each parameter, by its place in those of `_read_signals`, ``factors`` its
    factor in each equation. ``slopes`` has the slopes of the linear part with respect to the states, and
    behind them the products of effect and weights of each unit.
    """
    at_b, at_c, at_d, at_e, at_f, at_w, at_bias, at_drift, at_level = place_blocks(n, inputs, units)
    one = n + inputs
    step = -(-(one + 1) // VECTOR) * VECTOR
    at_units = (units + 1) * step
    sources[:], factors[:], slopes[:] = one, 0.0, 0.0
    for i in range(n + 1):
        of_states, of_inputs = (at_c, at_d) if i == n else (i * n, at_b + i * inputs)
        effects = at_f if i == n else at_e + i * units
        for j in range(n):
            _name(sources, factors, width, places[of_states + j], j, i, 1.0)
            slopes[i * n + j] = theta[of_states + j]
        for j in range(inputs):
            _name(sources, factors, width, places[of_inputs + j], n + j, i, 1.0)
        _name(sources, factors, width, places[at_level if i == n else at_drift + i], one, i, 1.0)
        for unit in range(units):
            effect, at = theta[effects + unit], (unit + 1) * step
            _name(sources, factors, width, places[effects + unit], at_units + unit, i, 1.0)
            for j in range(n + inputs):
                weight = at_w + unit * (n + inputs) + j
                _name(sources, factors, width, places[weight], at + j, i, effect)
                if j < n:
                    slopes[(unit + 1) * size + i * n + j] = effect * theta[weight]
            _name(sources, factors, width, places[at_bias + unit], at + one, i, effect)


@kernel(forceinline=True)
def _read_signals(traces, k, lane, n, units, u, signals):
    """Write the signals of a row: states, inputs and 1, their products with each slope, and units."""
    inputs = u.shape[1]
    step = -(-(n + inputs + 1) // VECTOR) * VECTOR
    for i in range(n):
        signals[i] = traces[k, i, lane]
    for j in range(inputs):
        signals[n + j] = u[k, j]
    for unit in range(units):
        slope = broadcast(traces[k, n + units + unit, lane], 1)
        for p in range(0, step, VECTOR):
            store(signals, (unit + 1) * step + p, multiply(slope, load(signals, p, 1)))
        signals[(units + 1) * step + unit] = traces[k, n + unit, lane]


@kernel(forceinline=True)
def _find_matrix(traces, k, lane, n, units, slopes, size, matrices, at):
    """Write the slopes of all equations with respect to the states."""
    for p in range(0, size, VECTOR):
        total = load(slopes, p, 1)
        for unit in range(units):
            slope = broadcast(traces[k, n + units + unit, lane], 1)
            total = multiply_add(slope, load(slopes, (unit + 1) * size + p, 1), total)
        store(matrices, at + p, total)


@kernel(forceinline=True, constants=("count",))
def _propagate(matrices, size, n, factors, values, width, p, rows, states, staged, count):
    """Propagate the derivatives with respect to ``8 * count`` parameters over some rows."""
    lanes = VECTOR * count
    begin = 2 * (n + 1) * p
    for row in range(rows):
        now = begin + (row & 1) * (n + 1) * lanes
        later = begin + (1 - (row & 1)) * (n + 1) * lanes
        value = load(values, row * width + p, count)
        for i in range(0, n, 2):
            at = row * size + i * n
            one = multiply(load(factors, i * width + p, count), value)
            other = multiply(load(factors, (i + 1) * width + p, count), value)
            for j in range(n):
                of_state = load(states, now + j * lanes, count)
                one = multiply_add(spread(matrices, at + j, count), of_state, one)
                other = multiply_add(spread(matrices, at + n + j, count), of_state, other)
            store(states, later + i * lanes, one)
            store(states, later + (i + 1) * lanes, other)
        if n % 2 == 0:
            last = multiply(load(factors, n * width + p, count), value)
            for j in range(n):
                of_state = load(states, now + j * lanes, count)
                last = multiply_add(spread(matrices, row * size + n * n + j, count), of_state, last)
            store(staged, row * width + p, last)
        else:
            store(staged, row * width + p, load(states, later + n * lanes, count))


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
def _begin(columns, n, wide, states):
    """Write the derivatives of the states at the first row: 1 with respect to themselves."""
    states[:] = 0.0
    for i in range(n):
        at = columns + i
        lanes = 4 * VECTOR if at < wide else 2 * VECTOR
        first = at - at % lanes if at < wide else wide
        states[2 * (n + 1) * first + i * lanes + at - first] = 1.0


@kernel(forceinline=True)
def _find_error(measured, simulated, lower, upper):
    """Return the error of a row, NaN if there is none."""
    error = measured - simulated
    beyond = (measured >= upper and error < 0.0) or (measured <= lower and error > 0.0)
    return math.nan if beyond else error


@kernel(forceinline=True)
def _fill_chunk(staged, errors, width, columns, filled, chunk):
    """Write the columns of eight rows into a chunk, whose columns are contiguous; 0 without an error."""
    for row in range(VECTOR):
        is_missing = math.isnan(errors[row])
        chunk[columns * CHUNK + filled + row] = 0.0 if is_missing else errors[row]
        if is_missing:
            staged[row * width : (row + 1) * width] = 0.0
    for p in range(columns):
        for row in range(VECTOR):
            chunk[p * CHUNK + filled + row] = staged[row * width + p]


@kernel(_nrt=False)
def _add_tiles(chunk, blocks, running, rows):
    """Add the products of a chunk of rows to the running sums of all tiles, four columns times four."""
    at = 0
    for one in range(blocks):
        i = 4 * one * CHUNK
        upper = load(running, at, 10)
        for row in range(i, i + rows, VECTOR):
            x = gather(chunk, row, row + CHUNK, row + 2 * CHUNK, row + 3 * CHUNK)
            upper = add_outer_upper(upper, x)
        store(running, at, upper)
        for other in range(one + 1, blocks):
            at += 16 * VECTOR
            apart = 4 * (other - one) * CHUNK
            whole = load(running, at, 16)
            for row in range(i, i + rows, VECTOR):
                x = gather(chunk, row, row + CHUNK, row + 2 * CHUNK, row + 3 * CHUNK)
                there = row + apart
                y = gather(chunk, there, there + CHUNK, there + 2 * CHUNK, there + 3 * CHUNK)
                whole = add_outer(whole, x, y)
            store(running, at, whole)
        at += 16 * VECTOR


@kernel
def accumulate_products(
    theta,
    places,  # int64 [parameter]: column of each parameter; -1 if it is fixed
    units,  # number of units
    traces,  # float64 [row, state and unit and unit, lane]: states, units and their slopes of a free run
    lane,
    u,
    y,  # float64 [row]: measured; NaN is left out
    lower,  # limits of the sensor: a measured limit is no error of a simulation beyond it
    upper,
    columns,  # number of free parameters; the states at the first row have the columns after them
    out,  # out, float64 [columns + states + 1, columns + states + 1]
    derivatives,  # out, float64 [columns + states + 1, row]: those of each row; of no columns, not written
):
    """Compute the inner products of all derivatives and of the error ``y - simulation``, which is last.

    Rows without an error have no derivatives.
    """
    n, inputs = traces.shape[1] - 2 * units, u.shape[1]
    free = columns + n
    width = -(-free // (2 * VECTOR)) * 2 * VECTOR
    size = -(-(n + 1) * n // VECTOR) * VECTOR
    sources, factors = np.empty(width, np.int64), padded_size((n + 1) * width)
    slopes = padded_size((units + 1) * size)
    step = -(-(n + inputs + 1) // VECTOR) * VECTOR
    signals = padded_size((units + 1) * step + units)
    signals[:] = 0.0
    signals[n + inputs] = 1.0
    h = signals[signals.size - units :]
    _prepare(theta, places, n, inputs, units, width, size, sources, factors, slopes)
    matrices, values = padded_size(VECTOR * size), padded_size(VECTOR * width)
    states, staged = padded_size(2 * (n + 1) * width), padded_size(VECTOR * width)
    wide = width - width % (4 * VECTOR)
    _begin(columns, n, wide, states)
    blocks = -(-(free + 1) // 4)
    tiles = blocks * (blocks + 1) // 2
    chunk, running = padded_size(4 * blocks * CHUNK), padded_size(16 * VECTOR * tiles)
    chunk[:], running[:] = 0.0, 0.0
    errors = np.empty(VECTOR)
    for begin in range(0, y.size, VECTOR):
        rows, filled = min(VECTOR, y.size - begin), begin % CHUNK
        if begin % _FLUSHED_ROWS == 0:
            _flush(states)
        errors[:] = math.nan
        for row in range(rows):
            k = begin + row
            _read_signals(traces, k, lane, n, units, u, signals)
            _find_matrix(traces, k, lane, n, units, slopes, size, matrices, row * size)
            for p in range(width):
                values[row * width + p] = signals[sources[p]]
            errors[row] = _find_error(y[k], compute_output(theta, n, inputs, signals, h), lower, upper)
        for p in range(0, wide, 4 * VECTOR):
            _propagate(matrices, size, n, factors, values, width, p, rows, states, staged, 4)
        for p in range(wide, width, 2 * VECTOR):
            _propagate(matrices, size, n, factors, values, width, p, rows, states, staged, 2)
        _fill_chunk(staged, errors, width, free, filled, chunk)
        for p in range(derivatives.shape[0]):
            derivatives[p, begin : begin + rows] = chunk[p * CHUNK + filled : p * CHUNK + filled + rows]
        if filled + VECTOR == CHUNK or begin + VECTOR >= y.size:
            _add_tiles(chunk, blocks, running, filled + VECTOR)
    read_tiles(running, blocks, 0, tiles, free + 1, out)
