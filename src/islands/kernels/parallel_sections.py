"""Triangular factor of the whitened responses and sensitivities of parallel sections, in blocks of samples.

A section divides a signal by ``1 + a1 q^-1 + a2 q^-2``. Its two responses are the quotient one sample before
and the difference to the sample before that one. All sections of all inputs, the initial states and the
derivatives are computed for a block of samples, filtered by the inverse of the noise, and reduced by
Householder reflections to a triangle, so that a record of any length needs the memory of a block.
"""

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

#: States that are less are zero. Arithmetic on subnormal numbers takes a hundred times as long.
_LEAST = 1e-150


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
    noise,  # float64 [1 or 2, state]: autoregression of the noise, and its moving average if it has one
    prior,  # float64 [state, state]: equations, with the right-hand side 0, of the noise before a recording
    coefficients,  # float64 [coefficient]: of every input the sections and the lead; the constant
    starts,  # float64 [recording, state]: initial states of the noise and of the sections
    derivatives,  # whether the columns of the noise and of the poles follow those of the coefficients
    residual,  # out, float64 [sample] or empty: the output less the free run
    factor,  # out, float64 [column, column] or empty: columns of the coefficients and so on; the residual
    own,  # out, float64 [recording, state, state + column]: the rows of the initial states
):
    """Compute the factor of all recordings, and the rows of the initial states of each one."""
    inputs, number, history, order = u.shape[0], sections.shape[0], noise.shape[1], starts.shape[1]
    free, after = number - integrators, order + coefficients.size
    columns = after + (noise.size + sizes[:free].sum() if derivatives else 0) + 1
    places, quotients = _place_filters(
        sections, sizes, integrators, leads, history, after, derivatives, noise.size
    )
    last = places.shape[0] - (free if derivatives else 0)
    states = np.empty((places.shape[0], 2))
    # Rows of samples begin with those of the block before that the noise reads.
    origin = -(-history // VECTOR) * VECTOR
    stride = origin + BLOCK
    # The second response of a first-order section is in a row that nothing reads.
    x = padded_size((columns + 1) * stride)
    # The inputs, a zero, a one, and the parts of the sections.
    sources = padded_size((inputs + 2 + number) * BLOCK)
    sources[:] = 0.0
    sources[(inputs + 1) * BLOCK : (inputs + 2) * BLOCK] = 1.0
    # After the columns: the responses of the noise to a pulse, to the residual and to the error.
    whitened = padded_size((columns + 3) * stride) if history else x
    w = padded_size((columns + 2) * BLOCK)
    w[columns * BLOCK :] = 0.0
    triangle = np.zeros((columns, columns + 2))
    target, begin = (columns - 1) * stride + origin, 0
    for recording in range(ends.size):
        end, counted = ends[recording], min(begin + skipped, ends[recording])
        states[:] = 0.0
        triangle[:order] = 0.0
        triangle[:history, :history] = prior
        at = begin
        while at < end:
            if at == counted:
                states[inputs * number : (inputs + 1) * number, 0] = 1.0
                x[:] = 0.0
                whitened[:] = 0.0
            rows = min(BLOCK, (counted if at < counted else end) - at)
            for place in range(inputs):
                for k in range(rows):
                    late = at + k - delays[place]
                    sources[place * BLOCK + k] = u[place, late] if late >= begin else before[recording, place]
            _divide(places, quotients, states, sources, x, stride, origin, rows, 0, last)
            for k in range(rows):
                x[target + k] = y[at + k]
            _run_freely(
                sources, x, stride, origin, rows, history, sizes, integrators, leads, coefficients,
                starts[recording], target, y.size,
            )  # fmt: skip
            _divide(places, quotients, states, sources, x, stride, origin, rows, last, places.shape[0])
            if at >= counted:
                if residual.size:
                    residual[at : at + rows] = x[target : target + rows]
                if factor.size:
                    derived = after if derivatives else columns
                    if history:
                        _whiten(x, noise, starts[recording], derived, columns, stride, origin, rows,
                                at == counted, whitened)  # fmt: skip
                    noises = noise.size if derivatives else 0
                    _fill(whitened, history, derived, noises, columns, stride, origin, rows, w)
                    _reflect(w, -(-rows // VECTOR) * VECTOR, columns, triangle)
                if history:
                    _keep_last(x, columns, stride, origin, history, rows)
                    _keep_last(whitened, columns + 3, stride, origin, history, rows)
            at += rows
        if factor.size:
            own[recording] = triangle[:order, :columns]
        begin = end
    if factor.size:
        factor[:] = triangle[order:, order:columns]


@kernel
def _place_filters(sections, sizes, integrators, leads, history, after, derivatives, noises):
    """Return the source and the two rows of every filter, and its coefficients."""
    inputs, number, free = leads.size, sections.shape[0], sections.shape[0] - integrators
    filters = number * (inputs + 1) + integrators + (free if derivatives else 0)
    places, quotients = np.zeros((filters, 3), np.int64), np.empty((filters, 2))
    row, f, unread = history + sizes.sum(), 0, after + 1
    if derivatives:
        unread += noises + sizes[:free].sum()
    for place in range(inputs + 2):  # the inputs, the initial states, and the derivatives
        at = row
        if place == inputs:
            at = history
            constant = row
        elif place == inputs + 1:
            at = after + noises
        for section in range(number if place <= inputs else free if derivatives else 0):
            places[f, 0] = place if place <= inputs else inputs + 2 + section
            places[f, 1] = at
            places[f, 2] = at + 1 if sizes[section] == 2 else unread
            quotients[f] = sections[section]
            at += sizes[section]
            f += 1
        if place < inputs:
            row = at + leads[place]
        if place == inputs and integrators:
            places[f, 0], places[f, 1], places[f, 2] = inputs + 1, constant, unread
            quotients[f] = sections[number - 1]
            f += 1
    return places, quotients


@kernel
def _divide(places, quotients, states, sources, x, stride, origin, rows, first, last):
    """Compute a block of the responses of some filters."""
    # A recursion waits for its last value. Four at a time take a third of the time of one after another.
    for f in range(first, last, 4):
        f1, f2, f3 = min(f + 1, last - 1), min(f + 2, last - 1), min(f + 3, last - 1)
        s0, s1 = np.uint64(places[f, 0] * BLOCK), np.uint64(places[f1, 0] * BLOCK)
        s2, s3 = np.uint64(places[f2, 0] * BLOCK), np.uint64(places[f3, 0] * BLOCK)
        i0, i1 = np.uint64(places[f, 1] * stride + origin), np.uint64(places[f1, 1] * stride + origin)
        i2, i3 = np.uint64(places[f2, 1] * stride + origin), np.uint64(places[f3, 1] * stride + origin)
        j0, j1 = np.uint64(places[f, 2] * stride + origin), np.uint64(places[f1, 2] * stride + origin)
        j2, j3 = np.uint64(places[f2, 2] * stride + origin), np.uint64(places[f3, 2] * stride + origin)
        a0, a1, a2, a3 = quotients[f, 0], quotients[f1, 0], quotients[f2, 0], quotients[f3, 0]
        b0, b1, b2, b3 = quotients[f, 1], quotients[f1, 1], quotients[f2, 1], quotients[f3, 1]
        v0, v1, v2, v3 = states[f, 0], states[f1, 0], states[f2, 0], states[f3, 0]
        z0, z1, z2, z3 = states[f, 1], states[f1, 1], states[f2, 1], states[f3, 1]
        for k in range(np.uint64(rows)):
            x[i0 + k], x[i1 + k], x[i2 + k], x[i3 + k] = v0, v1, v2, v3
            x[j0 + k], x[j1 + k], x[j2 + k], x[j3 + k] = v0 - z0, v1 - z1, v2 - z2, v3 - z3
            v0, z0 = sources[s0 + k] - b0 * z0 - a0 * v0, v0
            v1, z1 = sources[s1 + k] - b1 * z1 - a1 * v1, v1
            v2, z2 = sources[s2 + k] - b2 * z2 - a2 * v2, v2
            v3, z3 = sources[s3 + k] - b3 * z3 - a3 * v3, v3
        states[f, 0], states[f, 1] = v0, z0
        states[f1, 0], states[f1, 1] = v1, z1
        states[f2, 0], states[f2, 1] = v2, z2
        states[f3, 0], states[f3, 1] = v3, z3
        for g in range(f, f3 + 1):
            if abs(states[g, 0]) < _LEAST and abs(states[g, 1]) < _LEAST:
                states[g] = 0.0


@kernel
def _run_freely(
    sources, x, stride, origin, rows, history, sizes, integrators, leads, coefficients, start, target, samples
):
    """Subtract the free run from a block of the output; write minus the part of every section."""
    inputs, order = leads.size, start.size
    first = (inputs + 2) * BLOCK
    sources[first:] = 0.0
    row = order
    for place in range(inputs + 1):  # the inputs, and the initial states
        source = row if place < inputs else history
        for section in range(sizes.size):
            for _ in range(sizes[section]):
                weight = coefficients[source - order] if place < inputs else start[source]
                _subtract(sources, first + section * BLOCK, weight, x, source * stride + origin, rows)
                source += 1
        if place < inputs:
            row = source
            if leads[place]:
                _copy(x, row * stride + origin, sources, place * BLOCK, rows)
                _subtract(x, target, coefficients[row - order], sources, place * BLOCK, rows)
                row += 1
    for section in range(sizes.size):
        _subtract(x, target, -1.0, sources, first + section * BLOCK, rows)
    at = row * stride + origin
    for k in range(at, at + rows):
        x[k] = x[k] / samples if integrators else 1.0
    _subtract(x, target, coefficients[row - order], x, at, rows)


@kernel
def _whiten(x, noise, start, derived, columns, stride, origin, rows, begins, whitened):
    """Filter a block by the inverse of the noise; a pulse, residual and error by the moving average."""
    history = noise.shape[1]
    target, pulse = (columns - 1) * stride + origin, columns * stride + origin
    for row in range(history, columns):
        if not derived <= row < derived + noise.size:
            at = row * stride + origin
            _copy(whitened, at, x, at, rows)
            for lag in range(1, history + 1):
                _subtract(whitened, at, noise[0, lag - 1], x, at - lag, rows)
    whitened[pulse : pulse + rows] = 0.0
    if begins:
        whitened[pulse] = 1.0
    _copy(whitened, pulse + stride, x, target, rows)
    if noise.shape[0] == 2:
        _divide_by_average(noise[1], whitened, stride, origin, rows, history, columns + 2)
    _copy(whitened, pulse + 2 * stride, whitened, target, rows)
    for lag in range(history):
        _subtract(whitened, pulse + 2 * stride, start[lag], whitened, pulse - lag, rows)
    if noise.shape[0] == 2:
        _divide_by_average(noise[1], whitened, stride, origin, rows, columns + 2, columns + 3)


@kernel
def _divide_by_average(average, whitened, stride, origin, rows, first, last):
    """Divide rows by ``1 + c1 q^-1 + c2 q^-2 + ...`` in place."""
    count = np.uint64(average.size)
    for row in range(first, last, 4):
        # A row that is divided twice at the same time has the same values.
        r0, r1 = np.uint64(row * stride + origin), np.uint64(min(row + 1, last - 1) * stride + origin)
        r2 = np.uint64(min(row + 2, last - 1) * stride + origin)
        r3 = np.uint64(min(row + 3, last - 1) * stride + origin)
        for k in range(np.uint64(rows)):
            y0, y1, y2, y3 = whitened[r0 + k], whitened[r1 + k], whitened[r2 + k], whitened[r3 + k]
            for index in range(count):
                lag = count - index
                c, before = average[lag - np.uint64(1)], k - lag
                y0 -= c * whitened[r0 + before]
                y1 -= c * whitened[r1 + before]
                y2 -= c * whitened[r2 + before]
                y3 -= c * whitened[r3 + before]
            whitened[r0 + k], whitened[r1 + k], whitened[r2 + k], whitened[r3 + k] = y0, y1, y2, y3


@kernel
def _fill(whitened, history, derived, noises, columns, stride, origin, rows, w):
    """Copy a block of all columns, those of the noise from the lags of three rows."""
    for column in range(columns):
        row, lag = column, 0
        if column < history:
            row, lag = columns, column
        elif derived <= column < derived + noises:
            row, lag = columns + 1 + (column - derived) // history, (column - derived) % history + 1
        _copy(w, column * BLOCK, whitened, row * stride + origin - lag, rows)
        for k in range(rows, -(-rows // VECTOR) * VECTOR):
            w[column * BLOCK + k] = 0.0


@kernel
def _keep_last(x, count, stride, origin, history, rows):
    """Move the last samples of a block before the next one; those that are not normal numbers are zero."""
    for row in range(count):
        at = row * stride + origin
        for k in range(at - history, at):
            x[k] = x[k + rows] if abs(x[k + rows]) > _LEAST else 0.0


@kernel(_nrt=False)
def _copy(x, x_at, y, y_at, rows):
    for i in range(0, rows, VECTOR):
        store(x, x_at + i, load(y, y_at + i, 1))


@kernel(_nrt=False)
def _subtract(x, x_at, weight, y, y_at, rows):
    """Subtract in place: ``x -= weight * y``."""
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
