"""Triangular factor of the whitened responses and sensitivities of parallel sections, in blocks of samples.

A section divides a signal by ``1 + a1 q^-1 + a2 q^-2``. Its two responses are the quotient one sample before
and the difference to the sample before that one. All sections of all inputs, the initial states and the
derivatives are computed for a block of samples, filtered by the inverse of the noise, and reduced by
Householder reflections to a triangle, so that a record of any length needs the memory of a block.
"""

from typing import Any, NamedTuple

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import (
    VECTOR,
    add,
    broadcast,
    fold,
    load,
    multiply,
    padded_size,
    store,
    subtract,
)

#: Samples of a block; its rows fit into the cache of a processor.
BLOCK = 256

#: Least variance of the noise before a recording, and that of a random walk, where white noise has 1.
_LEAST_VARIANCE, _LARGEST_VARIANCE = 1e-10, 1e12

#: Part of this variance that is left out, and doublings of the number of samples that it is summed over.
_PRECISION, _MAX_DOUBLINGS = 1e-14, 50

#: States that are less are zero. Arithmetic on subnormal numbers takes a hundred times as long.
_LEAST = 1e-150


class BlockRows(NamedTuple):
    """Rows of samples of a block, each after the last samples of the block before.

    Attributes
    ----------
    values : ndarray, float64
    stride : int
        Values from the first one of a row to that of the next row.
    origin : int
        Samples of the block before.
    """

    values: Any
    stride: Any
    origin: Any


@kernel
def factor_sections(
    u,  # float64 [input, sample]
    y,  # float64 [sample]
    ends,  # int64 [recording]: the sample after the last one
    before,  # float64 [recording, input]: values of the inputs before the recordings
    skipped,  # samples of every recording that are not counted; the initial states apply after them
    sections,  # float64 [section, 2]: coefficients; the second one of a first-order section is 0
    sizes,  # int64 [section]: 1 or 2
    integrators,  # 1 if the last section is an integrator, whose constant is a ramp; else 0
    delays,  # int64 [input]: samples
    leads,  # bool [input]: the input itself is a response as well
    noise,  # float64 [2, state]: autoregression and moving average of the noise
    coefficients,  # float64 [coefficient]: of every input the sections and the lead; the constant
    starts,  # float64 [recording, state]: initial states of the noise and of the sections
    derivatives,  # whether the columns of the noise and of the poles follow those of the coefficients
    residual,  # out, float64 [sample] or empty: the output less the free run
    factor,  # out, float64 [column, column] or empty: columns of the coefficients and so on; the residual
    own,  # out, float64 [recording, state, state + column]: the rows of the initial states
):
    """Compute the factor of all recordings, and the rows of the initial states of each one.

    Derivatives are those of the free run and of the noise. The coordinates of a section of second order are
    ``a1 + a2`` and ``-a2``.
    """
    inputs, number, order = u.shape[0], sections.shape[0], starts.shape[1]
    free, after = number - integrators, order + coefficients.size
    columns = after + (noise.size + sizes[:free].sum() if derivatives else 0) + 1
    derived = after if derivatives else columns
    places, quotients = _place_filters(sections, sizes, integrators, leads, noise, derived, columns)
    last = places.shape[0] - (free if derivatives else 0)
    states = np.empty((places.shape[0], 2))
    # The second response of a first-order section is in a row that nothing reads.
    x = _allocate(columns + 1, noise.shape[1])
    # The inputs, a zero, a one, and the parts of the sections.
    sources = _allocate(inputs + 2 + number, 0)
    sources.values[(inputs + 1) * BLOCK : (inputs + 2) * BLOCK] = 1.0
    # After the columns: the responses of the noise to a pulse, to the residual and to the error.
    whitened = _allocate(columns + 3, noise.shape[1]) if noise.size else x
    # Reflections change two columns at a time.
    w = _allocate(columns + 2, 0).values
    triangle = np.zeros((columns, columns + 2))
    prior = weigh_past(noise)
    target, begin = (columns - 1) * x.stride + x.origin, 0
    for recording in range(ends.size):
        end, counted = ends[recording], min(begin + skipped, ends[recording])
        states[:] = 0.0
        triangle[:order] = 0.0
        triangle[: noise.shape[1], : noise.shape[1]] = prior
        at = begin
        while at < end:
            if at == counted:
                states[inputs * number : (inputs + 1) * number, 0] = 1.0
                x.values[:] = 0.0
                whitened.values[:] = 0.0
            rows = min(BLOCK, (counted if at < counted else end) - at)
            for place in range(inputs):
                for k in range(rows):
                    late = at + k - delays[place]
                    value = u[place, late] if late >= begin else before[recording, place]
                    sources.values[place * BLOCK + k] = value
            x.values[target : target + rows] = y[at : at + rows]
            _divide(places, quotients, states, sources, x, rows, 0, last)
            constant = 1.0 / y.size if integrators else 0.0
            _run_freely(
                sources, x, rows, noise, sizes, constant, leads, coefficients, starts[recording], target
            )
            _divide(places, quotients, states, sources, x, rows, last, places.shape[0])
            if at >= counted:
                if residual.size:
                    residual[at : at + rows] = x.values[target : target + rows]
                if factor.size:
                    if noise.size:
                        _whiten(x, noise, starts[recording], derived, columns, rows, at == counted, whitened)
                    _fill(whitened, noise, derived, columns, rows, w)
                    _reflect(w, -(-rows // VECTOR) * VECTOR, columns, triangle)
                _keep_last(x, columns, noise.shape[1], rows)
                _keep_last(whitened, columns + 3 if noise.size else 0, noise.shape[1], rows)
            at += rows
        if factor.size:
            own[recording] = triangle[:order, :columns]
        begin = end
    if factor.size:
        factor[:] = triangle[order:, order:columns]


@kernel
def weigh_past(noise):
    """Return equations whose squares are the deviance of the noise before a recording.

    They are zero for a random walk, which may begin anywhere. Without equations, noise could follow the
    response of the system as a decay from its own states.
    """
    count = noise.shape[1]
    prior, sums, largest = np.zeros((count, count)), np.empty((count, count)), 0.0
    power, covariance = np.zeros((count, count)), np.empty((count, count))
    if count == 0:
        return prior
    for i in range(count):
        power[i, 0] = noise[0, i]
        if i + 1 < count:
            power[i, i + 1] = 1.0
        for j in range(count):
            covariance[i, j] = (noise[0, i] + noise[1, i]) * (noise[0, j] + noise[1, j])
    # The sum of 2, 4, 8, ... terms of the response to white noise.
    for _ in range(_MAX_DOUBLINGS):
        _multiply(power, covariance, False, sums)
        added = sums.copy()
        _multiply(added, power, True, sums)
        covariance += sums
        largest = np.abs(covariance).max()
        if not largest < _LARGEST_VARIANCE:
            return prior
        if np.abs(sums).max() <= _PRECISION * largest:
            break
        added[:] = power
        _multiply(added, added, False, power)
    # Rounding may leave a covariance that is not positive.
    upper, least = np.zeros((count, count)), _LEAST_VARIANCE + 100.0 * _PRECISION * largest
    while not _factor_covariance(covariance, least, upper):
        least *= 100.0
    for j in range(count):
        prior[j, j] = 1.0 / upper[j, j]
        for i in range(j - 1, -1, -1):
            value = 0.0
            for k in range(i + 1, j + 1):
                value -= upper[i, k] * prior[k, j]
            prior[i, j] = value / upper[i, i]
    return prior


@kernel
def _factor_covariance(covariance, least, upper):
    """Write the upper factor of a covariance with an added variance; return whether it is positive."""
    for j in range(covariance.shape[0] - 1, -1, -1):
        for i in range(j, -1, -1):
            value = covariance[i, j] + (least if i == j else 0.0)
            for k in range(j + 1, covariance.shape[0]):
                value -= upper[i, k] * upper[j, k]
            if i < j:
                upper[i, j] = value / upper[j, j]
            elif value < 0.5 * least:
                return False
            else:
                upper[j, j] = np.sqrt(value)
    return True


@kernel
def _multiply(a, b, transposed, out):
    """Write the product of two square matrices, of which the second one may be transposed."""
    count = a.shape[0]
    for i in range(count):
        for j in range(count):
            value = 0.0
            for k in range(count):
                value += a[i, k] * (b[j, k] if transposed else b[k, j])
            out[i, j] = value


@kernel
def _allocate(rows, history):
    origin = -(-history // VECTOR) * VECTOR
    values = padded_size(rows * (origin + BLOCK))
    values[:] = 0.0
    return BlockRows(values, origin + BLOCK, origin)


@kernel
def _place_filters(sections, sizes, integrators, leads, noise, derived, columns):
    """Return the source and the two rows of every filter, and its coefficients."""
    inputs, number, free = leads.size, sections.shape[0], sections.shape[0] - integrators
    derivatives = free if derived < columns else 0
    filters = number * (inputs + 1) + integrators + derivatives
    places, quotients = np.zeros((filters, 3), np.int64), np.empty((filters, 2))
    row, f = noise.shape[1] + sizes.sum(), 0
    for place in range(inputs + 2):  # the inputs, the initial states, and the derivatives
        at = row
        if place == inputs:
            at = noise.shape[1]
        elif place == inputs + 1:
            at = derived + noise.size
        for section in range(number if place <= inputs else derivatives):
            places[f, 0] = place if place <= inputs else inputs + 2 + section
            places[f, 1] = at
            places[f, 2] = at + 1 if sizes[section] == 2 else columns
            quotients[f] = sections[section]
            at += sizes[section]
            f += 1
        if place < inputs:
            row = at + leads[place]
        if place == inputs and integrators:  # the constant
            places[f, 0], places[f, 1], places[f, 2] = inputs + 1, row, columns
            quotients[f] = sections[number - 1]
            f += 1
    return places, quotients


@kernel
def _divide(places, quotients, states, sources, x, rows, first, last):
    """Compute a block of the responses of some filters."""
    source, values = sources.values, x.values
    # A recursion waits for its last value. Four at a time take a third of the time of one after another.
    for f in range(first, last, 4):
        f1, f2, f3 = min(f + 1, last - 1), min(f + 2, last - 1), min(f + 3, last - 1)
        s0, i0, j0 = _find_rows(places, f, x)
        s1, i1, j1 = _find_rows(places, f1, x)
        s2, i2, j2 = _find_rows(places, f2, x)
        s3, i3, j3 = _find_rows(places, f3, x)
        a0, a1, a2, a3 = quotients[f, 0], quotients[f1, 0], quotients[f2, 0], quotients[f3, 0]
        b0, b1, b2, b3 = quotients[f, 1], quotients[f1, 1], quotients[f2, 1], quotients[f3, 1]
        v0, v1, v2, v3 = states[f, 0], states[f1, 0], states[f2, 0], states[f3, 0]
        z0, z1, z2, z3 = states[f, 1], states[f1, 1], states[f2, 1], states[f3, 1]
        for k in range(np.uint64(rows)):
            values[i0 + k], values[i1 + k], values[i2 + k], values[i3 + k] = v0, v1, v2, v3
            values[j0 + k], values[j1 + k] = v0 - z0, v1 - z1
            values[j2 + k], values[j3 + k] = v2 - z2, v3 - z3
            v0, z0 = source[s0 + k] - b0 * z0 - a0 * v0, v0
            v1, z1 = source[s1 + k] - b1 * z1 - a1 * v1, v1
            v2, z2 = source[s2 + k] - b2 * z2 - a2 * v2, v2
            v3, z3 = source[s3 + k] - b3 * z3 - a3 * v3, v3
        states[f, 0], states[f, 1] = v0, z0
        states[f1, 0], states[f1, 1] = v1, z1
        states[f2, 0], states[f2, 1] = v2, z2
        states[f3, 0], states[f3, 1] = v3, z3
        for g in range(f, f3 + 1):
            if abs(states[g, 0]) < _LEAST and abs(states[g, 1]) < _LEAST:
                states[g] = 0.0


@kernel
def _find_rows(places, f, x):
    """Return where the source and the rows of a filter begin; a number without a sign needs no check."""
    one, other = places[f, 1] * x.stride + x.origin, places[f, 2] * x.stride + x.origin
    return np.uint64(places[f, 0] * BLOCK), np.uint64(one), np.uint64(other)


@kernel
def _run_freely(sources, x, rows, noise, sizes, constant, leads, coefficients, start, target):
    """Subtract the free run from a block of the output; write minus the part of every section."""
    values, inputs, order = x.values, leads.size, start.size
    first = (inputs + 2) * BLOCK
    sources.values[first:] = 0.0
    row = order
    for place in range(inputs + 1):  # the inputs, and the initial states
        source = row if place < inputs else noise.shape[1]
        for section in range(sizes.size):
            for _ in range(sizes[section]):
                weight = coefficients[source - order] if place < inputs else start[source]
                part = first + section * BLOCK
                _subtract(sources.values, part, weight, values, source * x.stride + x.origin, rows)
                source += 1
        if place < inputs:
            row = source
            if leads[place]:
                _copy(values, row * x.stride + x.origin, sources.values, place * BLOCK, rows)
                _subtract(values, target, coefficients[row - order], sources.values, place * BLOCK, rows)
                row += 1
    for section in range(sizes.size):
        _subtract(values, target, -1.0, sources.values, first + section * BLOCK, rows)
    at = row * x.stride + x.origin
    for k in range(at, at + rows):
        values[k] = values[k] * constant if constant else 1.0
    _subtract(values, target, coefficients[row - order], values, at, rows)


@kernel
def _whiten(x, noise, start, derived, columns, rows, begins, whitened):
    """Filter a block by the inverse of the noise; a pulse, residual and error by the moving average."""
    history, values = noise.shape[1], whitened.values
    target, pulse = (columns - 1) * x.stride + x.origin, columns * x.stride + x.origin
    for row in range(history, columns):
        if not derived <= row < derived + noise.size:
            at = row * x.stride + x.origin
            _copy(values, at, x.values, at, rows)
            for lag in range(1, history + 1):
                _subtract(values, at, noise[0, lag - 1], x.values, at - lag, rows)
    values[pulse : pulse + rows] = 0.0
    if begins:
        values[pulse] = 1.0
    residual, error = pulse + x.stride, pulse + 2 * x.stride
    _copy(values, residual, x.values, target, rows)
    _divide_by_average(noise[1], whitened, rows, history, columns + 2)
    _copy(values, error, values, target, rows)
    for lag in range(history):
        _subtract(values, error, start[lag], values, pulse - lag, rows)
    _divide_by_average(noise[1], whitened, rows, columns + 2, columns + 3)


@kernel
def _divide_by_average(average, whitened, rows, first, last):
    """Divide rows by ``1 + c1 q^-1 + c2 q^-2 + ...`` in place."""
    values, count = whitened.values, np.uint64(average.size)
    for row in range(first, last, 4):
        # A row that is divided twice at the same time has the same values.
        r0, r1 = np.uint64(row), np.uint64(min(row + 1, last - 1))
        r2, r3 = np.uint64(min(row + 2, last - 1)), np.uint64(min(row + 3, last - 1))
        stride, origin = np.uint64(whitened.stride), np.uint64(whitened.origin)
        r0, r1, r2, r3 = (
            r0 * stride + origin,
            r1 * stride + origin,
            r2 * stride + origin,
            r3 * stride + origin,
        )
        for k in range(np.uint64(rows)):
            y0, y1, y2, y3 = values[r0 + k], values[r1 + k], values[r2 + k], values[r3 + k]
            for index in range(count):
                lag = count - index
                c, before = average[lag - np.uint64(1)], k - lag
                y0 -= c * values[r0 + before]
                y1 -= c * values[r1 + before]
                y2 -= c * values[r2 + before]
                y3 -= c * values[r3 + before]
            values[r0 + k], values[r1 + k], values[r2 + k], values[r3 + k] = y0, y1, y2, y3


@kernel
def _fill(whitened, noise, derived, columns, rows, w):
    """Copy a block of all columns, those of the noise from the lags of three rows."""
    history = noise.shape[1]
    for column in range(columns):
        row, lag = column, 0
        if column < history:
            row, lag = columns, column
        elif derived <= column < derived + noise.size:
            row, lag = columns + 1 + (column - derived) // history, (column - derived) % history + 1
        _copy(w, column * BLOCK, whitened.values, row * whitened.stride + whitened.origin - lag, rows)
        for k in range(rows, -(-rows // VECTOR) * VECTOR):
            w[column * BLOCK + k] = 0.0


@kernel
def _keep_last(x, count, history, rows):
    """Move the last samples of a block before the next one; those that are not normal numbers are zero."""
    for row in range(count):
        at = row * x.stride + x.origin
        for k in range(at - history, at):
            x.values[k] = x.values[k + rows] if abs(x.values[k + rows]) > _LEAST else 0.0


@kernel(_nrt=False)
def _copy(x, x_at, y, y_at, rows):
    """Copy up to the end of the last vector."""
    for i in range(0, rows, VECTOR):
        store(x, x_at + i, load(y, y_at + i, 1))


@kernel(_nrt=False)
def _subtract(x, x_at, weight, y, y_at, rows):
    """Subtract in place: ``x -= weight * y``, up to the end of the last vector."""
    if weight != 0.0:
        lanes = broadcast(weight, 1)
        for i in range(0, rows, VECTOR):
            store(x, x_at + i, subtract(load(x, x_at + i, 1), multiply(lanes, load(y, y_at + i, 1))))


@kernel(_nrt=False)
def _reflect(w, rows, columns, triangle):
    """Add rows to a triangle by Householder reflections, two columns at a time."""
    for j in range(0, columns, 2):
        one, other = j * BLOCK, (j + 1) * BLOCK
        scale_one, head_one = _find_reflection(w, one, rows, triangle, j)
        cross = head_other = scale_other = 0.0
        if j + 1 < columns:
            lanes = broadcast(0.0, 1)
            for i in range(0, rows, VECTOR):
                lanes = add(lanes, multiply(load(w, one + i, 1), load(w, other + i, 1)))
            weight = scale_one * (head_one * triangle[j, j + 1] + fold(lanes))
            triangle[j, j + 1] -= weight * head_one
            _subtract(w, other, weight, w, one, rows)
            scale_other, head_other = _find_reflection(w, other, rows, triangle, j + 1)
            lanes = broadcast(0.0, 1)
            for i in range(0, rows, VECTOR):
                lanes = add(lanes, multiply(load(w, one + i, 1), load(w, other + i, 1)))
            cross = fold(lanes)
        if scale_one == 0.0 and scale_other == 0.0:
            continue
        for k in range(j + 2, columns, 2):
            a, b = k * BLOCK, (k + 1) * BLOCK
            s0, s1, s2, s3 = broadcast(0.0, 1), broadcast(0.0, 1), broadcast(0.0, 1), broadcast(0.0, 1)
            for i in range(0, rows, VECTOR):
                v, z, p, q = load(w, one + i, 1), load(w, other + i, 1), load(w, a + i, 1), load(w, b + i, 1)
                s0 = add(s0, multiply(v, p))
                s1 = add(s1, multiply(z, p))
                s2 = add(s2, multiply(v, q))
                s3 = add(s3, multiply(z, q))
            t0 = scale_one * (head_one * triangle[j, k] + fold(s0))
            t2 = scale_one * (head_one * triangle[j, k + 1] + fold(s2))
            triangle[j, k] -= t0 * head_one
            triangle[j, k + 1] -= t2 * head_one
            t1 = t3 = 0.0
            if scale_other != 0.0:
                t1 = scale_other * (head_other * triangle[j + 1, k] + fold(s1) - t0 * cross)
                t3 = scale_other * (head_other * triangle[j + 1, k + 1] + fold(s3) - t2 * cross)
                triangle[j + 1, k] -= t1 * head_other
                triangle[j + 1, k + 1] -= t3 * head_other
            s0, s1, s2, s3 = broadcast(t0, 1), broadcast(t1, 1), broadcast(t2, 1), broadcast(t3, 1)
            for i in range(0, rows, VECTOR):
                v, z = load(w, one + i, 1), load(w, other + i, 1)
                store(w, a + i, subtract(subtract(load(w, a + i, 1), multiply(s0, v)), multiply(s1, z)))
                store(w, b + i, subtract(subtract(load(w, b + i, 1), multiply(s2, v)), multiply(s3, z)))


@kernel(_nrt=False)
def _find_reflection(w, at, rows, triangle, j):
    """Reflect a column; return the scale of the reflection, 0 for a column of zeros, and its first value."""
    lanes = broadcast(0.0, 1)
    for i in range(at, at + rows, VECTOR):
        v = load(w, i, 1)
        lanes = add(lanes, multiply(v, v))
    square, head = fold(lanes), triangle[j, j]
    if square == 0.0:
        return 0.0, 0.0
    norm = np.sqrt(head * head + square)
    triangle[j, j] = -norm if head > 0.0 else norm
    head -= triangle[j, j]
    return 2.0 / (head * head + square), head


@kernel
def solve_rows(
    rows,  # in and out, float64 [row, column]: the last column is the right-hand side; becomes a triangle
    units,  # float64 [column less one]: norms of the columns in the equations that the rows come from
    tolerance,  # a column that keeps at most this part of its norm depends on the columns before it
    solution,  # out, float64 [column less one]: 0 for a dependent column
):
    """Solve linear equations by least squares; return the sum of the squares that is left."""
    count, unknowns = rows.shape[0], rows.shape[1] - 1
    pivots, rank = np.empty(unknowns, np.int64), 0
    for j in range(unknowns):
        square = 0.0
        for i in range(rank + 1, count):
            square += rows[i, j] * rows[i, j]
        head = rows[rank, j] if rank < count else 0.0
        norm = np.sqrt(head * head + square)
        if not norm > tolerance * units[j]:
            continue
        if square > 0.0:
            first = head + norm if head > 0.0 else head - norm
            scale = 2.0 / (first * first + square)
            for k in range(j + 1, unknowns + 1):
                weight = first * rows[rank, k]
                for i in range(rank + 1, count):
                    weight += rows[i, j] * rows[i, k]
                weight *= scale
                rows[rank, k] -= weight * first
                for i in range(rank + 1, count):
                    rows[i, k] -= weight * rows[i, j]
            rows[rank, j] = head - first
            rows[rank + 1 :, j] = 0.0
        pivots[rank] = j
        rank += 1
    solution[:] = 0.0
    for i in range(rank - 1, -1, -1):
        value = rows[i, unknowns]
        for k in range(i + 1, rank):
            value -= rows[i, pivots[k]] * solution[pivots[k]]
        solution[pivots[i]] = value / rows[i, pivots[i]]
    left = 0.0
    for i in range(rank, count):
        left += rows[i, unknowns] ** 2
    return left
