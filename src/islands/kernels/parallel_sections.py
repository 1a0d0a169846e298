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
    # The second response of a first-order section is in a row that nothing reads.
    x = np.empty((columns + 1, history + BLOCK))
    sources = np.zeros((inputs + 2 + free, BLOCK))
    # After the columns: the responses of the noise to a pulse, to the residual and to the error.
    whitened = np.empty((columns + 3, history + BLOCK))
    w = padded_size((columns + 3) * BLOCK)
    w[columns * BLOCK :] = 0.0
    triangle = np.zeros((columns, columns + 3))
    begin = 0
    for recording in range(ends.size):
        end, counted = ends[recording], min(begin + skipped, ends[recording])
        states[:] = 0.0
        triangle[:order] = 0.0
        triangle[:history, :history] = prior
        at = begin
        while at < end:
            if at == counted:
                states[inputs * number : (inputs + 1) * number, 0] = 1.0
                x[:, :history] = 0.0
                whitened[:, :history] = 0.0
            rows = min(BLOCK, (counted if at < counted else end) - at)
            for place in range(inputs):
                for k in range(rows):
                    sources[place, k] = u[place, max(at + k - delays[place], begin)]
            sources[inputs + 1] = 1.0
            _divide(places, quotients, states, sources, x, history, rows, 0, last)
            x[columns - 1, history : history + rows] = y[at : at + rows]
            _run_freely(
                sources,
                x,
                rows,
                history,
                sizes,
                integrators,
                leads,
                coefficients,
                starts[recording],
                columns - 1,
                y.size,
            )
            _divide(places, quotients, states, sources, x, history, rows, last, places.shape[0])
            if at >= counted:
                if residual.size:
                    residual[at : at + rows] = x[columns - 1, history : history + rows]
                if factor.size:
                    _whiten(
                        x,
                        noise,
                        starts[recording],
                        after if derivatives else columns,
                        rows,
                        at == counted,
                        whitened,
                    )
                    _fill(whitened, history, after, noise.size if derivatives else 0, columns, rows, w)
                    _reflect(w, -(-rows // VECTOR) * VECTOR, columns, triangle)
                for k in range(history):
                    x[:, k] = x[:, rows + k]
                    whitened[:, k] = whitened[:, rows + k]
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
def _divide(places, quotients, states, sources, x, history, rows, first, last):
    """Compute a block of the responses of some filters."""
    # A recursion waits for its last value. Four at a time take a third of the time of one after another.
    for f in range(first, last, 4):
        f1, f2, f3 = min(f + 1, last - 1), min(f + 2, last - 1), min(f + 3, last - 1)
        s0, s1, s2, s3 = places[f, 0], places[f1, 0], places[f2, 0], places[f3, 0]
        i0, i1, i2, i3 = places[f, 1], places[f1, 1], places[f2, 1], places[f3, 1]
        j0, j1, j2, j3 = places[f, 2], places[f1, 2], places[f2, 2], places[f3, 2]
        a0, a1, a2, a3 = quotients[f, 0], quotients[f1, 0], quotients[f2, 0], quotients[f3, 0]
        b0, b1, b2, b3 = quotients[f, 1], quotients[f1, 1], quotients[f2, 1], quotients[f3, 1]
        v0, v1, v2, v3 = states[f, 0], states[f1, 0], states[f2, 0], states[f3, 0]
        z0, z1, z2, z3 = states[f, 1], states[f1, 1], states[f2, 1], states[f3, 1]
        for k in range(rows):
            at = history + k
            x[i0, at], x[i1, at], x[i2, at], x[i3, at] = v0, v1, v2, v3
            x[j0, at], x[j1, at], x[j2, at], x[j3, at] = v0 - z0, v1 - z1, v2 - z2, v3 - z3
            v0, z0 = sources[s0, k] - b0 * z0 - a0 * v0, v0
            v1, z1 = sources[s1, k] - b1 * z1 - a1 * v1, v1
            v2, z2 = sources[s2, k] - b2 * z2 - a2 * v2, v2
            v3, z3 = sources[s3, k] - b3 * z3 - a3 * v3, v3
        states[f, 0], states[f, 1] = v0, z0
        states[f1, 0], states[f1, 1] = v1, z1
        states[f2, 0], states[f2, 1] = v2, z2
        states[f3, 0], states[f3, 1] = v3, z3
        for g in range(f, f3 + 1):
            if abs(states[g, 0]) < _LEAST and abs(states[g, 1]) < _LEAST:
                states[g] = 0.0


@kernel
def _run_freely(sources, x, rows, history, sizes, integrators, leads, coefficients, start, target, samples):
    """Subtract the free run from a block of the output; write minus the part of every section."""
    first, inputs, free, order = history, leads.size, sizes.size - integrators, start.size
    parts = sources[inputs + 2 :]
    parts[:] = 0.0
    row = order
    for place in range(inputs + 1):  # the inputs, and the initial states
        source = row if place < inputs else history
        for section in range(sizes.size):
            for _ in range(sizes[section]):
                weight = coefficients[source - order] if place < inputs else start[source]
                if weight != 0.0:
                    for k in range(rows):
                        x[target, first + k] -= weight * x[source, first + k]
                    if section < free:
                        for k in range(rows):
                            parts[section, k] -= weight * x[source, first + k]
                source += 1
        if place < inputs:
            row = source
            if leads[place]:
                for k in range(rows):
                    x[row, first + k] = sources[place, k]
                    x[target, first + k] -= coefficients[row - order] * sources[place, k]
                row += 1
    for k in range(first, first + rows):
        x[row, k] = x[row, k] / samples if integrators else 1.0
        x[target, k] -= coefficients[row - order] * x[row, k]


@kernel
def _whiten(x, noise, start, derived, rows, begins, whitened):
    """Filter a block by the inverse of the noise, and a pulse, the residual and the error by the moving average."""
    history, columns = noise.shape[1], x.shape[0] - 1
    target, pulse = columns - 1, columns
    last = history + rows
    for row in range(history, columns):
        if derived <= row < derived + noise.size:
            continue
        for k in range(history, last):
            whitened[row, k] = x[row, k]
        for lag in range(1, history + 1):
            coefficient = noise[0, lag - 1]
            for k in range(history, last):
                whitened[row, k] -= coefficient * x[row, k - lag]
    if history == 0:
        return
    for k in range(history, last):
        whitened[pulse, k] = 0.0
        whitened[pulse + 1, k] = x[target, k]
    if begins:
        whitened[pulse, history] = 1.0
    if noise.shape[0] == 2:
        _divide_by_average(noise[1], whitened, history, rows, history, pulse + 2)
    for k in range(history, last):
        whitened[pulse + 2, k] = whitened[target, k]
    for lag in range(history):
        for k in range(history, last):
            whitened[pulse + 2, k] -= start[lag] * whitened[pulse, k - lag]
    if noise.shape[0] == 2:
        _divide_by_average(noise[1], whitened, history, rows, pulse + 2, pulse + 3)


@kernel
def _divide_by_average(average, whitened, history, rows, first, last):
    """Divide rows by ``1 + c1 q^-1 + c2 q^-2 + ...`` in place."""
    for r0 in range(first, last, 4):
        # A row that is divided twice at the same time has the same values.
        r1, r2, r3 = min(r0 + 1, last - 1), min(r0 + 2, last - 1), min(r0 + 3, last - 1)
        for k in range(history, history + rows):
            y0, y1, y2, y3 = whitened[r0, k], whitened[r1, k], whitened[r2, k], whitened[r3, k]
            for lag in range(average.size, 0, -1):
                c = average[lag - 1]
                y0 -= c * whitened[r0, k - lag]
                y1 -= c * whitened[r1, k - lag]
                y2 -= c * whitened[r2, k - lag]
                y3 -= c * whitened[r3, k - lag]
            whitened[r0, k], whitened[r1, k], whitened[r2, k], whitened[r3, k] = y0, y1, y2, y3
        for r in range(r0, r3 + 1):
            least = 0.0
            for k in range(rows, rows + history):
                least = max(least, abs(whitened[r, k]))
            if least < _LEAST:
                whitened[r, rows : rows + history] = 0.0


@kernel
def _fill(whitened, history, derived, noises, columns, rows, w):
    """Copy a block of all columns, those of the noise from the lags of three rows."""
    for column in range(columns):
        row, lag = column, 0
        if column < history:
            row, lag = columns, column
        elif derived <= column < derived + noises:
            row, lag = columns + 1 + (column - derived) // history, (column - derived) % history + 1
        at, first = column * BLOCK, history - lag
        for k in range(rows):
            w[at + k] = whitened[row, first + k]
        for k in range(rows, -(-rows // VECTOR) * VECTOR):
            w[at + k] = 0.0


@kernel(_nrt=False)
def _reflect(w, rows, columns, triangle):
    """Add rows to a triangle by Householder reflections."""
    for j in range(columns):
        at = j * BLOCK
        lanes = broadcast(0.0, 1)
        for i in range(at, at + rows, VECTOR):
            v = load(w, i, 1)
            lanes = add(lanes, multiply(v, v))
        square, head = fold(lanes), triangle[j, j]
        if square == 0.0:
            continue
        norm = np.sqrt(head * head + square)
        triangle[j, j] = -norm if head > 0.0 else norm
        head -= triangle[j, j]
        scale = 2.0 / (head * head + square)
        for k in range(j + 1, columns, 4):
            a = k * BLOCK
            b, c, d = a + BLOCK, a + 2 * BLOCK, a + 3 * BLOCK
            s0, s1, s2, s3 = broadcast(0.0, 1), broadcast(0.0, 1), broadcast(0.0, 1), broadcast(0.0, 1)
            for i in range(0, rows, VECTOR):
                v = load(w, at + i, 1)
                s0 = add(s0, multiply(v, load(w, a + i, 1)))
                s1 = add(s1, multiply(v, load(w, b + i, 1)))
                s2 = add(s2, multiply(v, load(w, c + i, 1)))
                s3 = add(s3, multiply(v, load(w, d + i, 1)))
            t0 = scale * (head * triangle[j, k] + fold(s0))
            t1 = scale * (head * triangle[j, k + 1] + fold(s1))
            t2 = scale * (head * triangle[j, k + 2] + fold(s2))
            t3 = scale * (head * triangle[j, k + 3] + fold(s3))
            triangle[j, k] -= t0 * head
            triangle[j, k + 1] -= t1 * head
            triangle[j, k + 2] -= t2 * head
            triangle[j, k + 3] -= t3 * head
            s0, s1, s2, s3 = broadcast(t0, 1), broadcast(t1, 1), broadcast(t2, 1), broadcast(t3, 1)
            for i in range(0, rows, VECTOR):
                v = load(w, at + i, 1)
                store(w, a + i, subtract(load(w, a + i, 1), multiply(s0, v)))
                store(w, b + i, subtract(load(w, b + i, 1), multiply(s1, v)))
                store(w, c + i, subtract(load(w, c + i, 1), multiply(s2, v)))
                store(w, d + i, subtract(load(w, d + i, 1), multiply(s3, v)))


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
