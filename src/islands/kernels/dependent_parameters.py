"""Parameters of a state space whose derivatives are combinations of those of other ones.

Other coordinates of the states, ``z = T x + t``, give the same output. The derivative of the output in the
direction of such a change is zero. Each direction therefore expresses the derivatives with respect to one
parameter by those with respect to the others and to the states at the first rows. A free system of n states
has n (n + 1) of these parameters, about a third of all, whose derivatives need not be propagated.
"""

import numpy as np

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, load, multiply_add, padded_size, spread, store
from islands.kernels.state_space import place_blocks

#: Least coefficient of a dependent parameter in its direction, relative to the largest before the others are
#: eliminated: with a smaller one, the combinations would be inaccurate.
_LEAST_PIVOT = 1e-2


@kernel
def _write_direction(theta, n, inputs, units, i, j, tangent):
    """Write the change of the parameters that adds state j to state i, or a constant for ``j = n``."""
    at_b, at_c, _, at_e, _, at_w, at_bias, at_drift, at_level = place_blocks(n, inputs, units)
    tangent[:] = 0.0
    if j == n:
        tangent[at_drift + i] = 1.0
        tangent[at_level] = -theta[at_c + i]
        for a in range(n):
            tangent[at_drift + a] -= theta[a * n + i]
        for unit in range(units):
            tangent[at_bias + unit] = -theta[at_w + unit * (n + inputs) + i]
        return
    tangent[at_drift + i] = theta[at_drift + j]
    tangent[at_c + j] = -theta[at_c + i]
    for a in range(n):
        tangent[i * n + a] += theta[j * n + a]
        tangent[a * n + j] -= theta[a * n + i]
    for a in range(inputs):
        tangent[at_b + i * inputs + a] = theta[at_b + j * inputs + a]
    for unit in range(units):
        tangent[at_e + i * units + unit] = theta[at_e + j * units + unit]
        tangent[at_w + unit * (n + inputs) + j] = -theta[at_w + unit * (n + inputs) + i]


@kernel
def _collect_directions(theta, places, inputs, units, starts, columns, directions):
    """Write the directions that change no fixed parameter; return their number."""
    segments, n = starts.shape
    tangent, count = np.empty(theta.size), 0
    for i in range(n):
        for j in range(n + 1):
            _write_direction(theta, n, inputs, units, i, j, tangent)
            row, is_free = directions[count], True
            row[:] = 0.0
            for place in range(theta.size):
                if places[place] >= 0:
                    row[places[place]] = tangent[place]
                elif tangent[place] != 0.0:
                    is_free = False
            for segment in range(segments):
                row[columns + segment * n + i] = 1.0 if j == n else starts[segment, j]
            count += is_free
    return count


@kernel
def find_dependent(
    theta,
    places,  # int64 [parameter]: column of each parameter; -1 if it is fixed
    inputs,
    units,
    starts,  # float64 [segment, state]: states at the first rows
    columns,  # number of free parameters
    directions,  # out, float64 [states * (states + 1), columns + segments * states]
    dependent,  # out, int64 [states * (states + 1)]: column of each dependent parameter
):
    """Find dependent parameters, by elimination with pivots; return their number.

    The derivative with respect to ``dependent[k]`` is that of all other columns times ``-directions[k]``,
    which has no other dependent one.
    """
    rows, count = _collect_directions(theta, places, inputs, units, starts, columns, directions), 0
    largest = np.empty(rows)
    for k in range(rows):
        largest[k] = np.abs(directions[k, :columns]).max() if columns else 0.0
    for k in range(rows):
        row, pivot = directions[k], -1
        for c in range(columns):
            if pivot < 0 or abs(row[c]) > abs(row[pivot]):
                pivot = c
        if pivot < 0 or not abs(row[pivot]) > _LEAST_PIVOT * largest[k]:
            continue
        factor = 1.0 / row[pivot]
        for c in range(row.size):
            directions[count, c] = 1.0 if c == pivot else factor * row[c]
        # The rows before are complete, those between them and the later ones are left out.
        for other in range(rows):
            ratio = directions[other, pivot]
            if ratio != 0.0 and (other < count or other > k):
                for c in range(row.size):
                    directions[other, c] -= ratio * directions[count, c]
                directions[other, pivot] = 0.0
        dependent[count] = pivot
        count += 1
    return count


@kernel(forceinline=True)
def _add_rows(weights, at, step, rows, first, count, width, out, begin):
    """Add weighted rows, whose width is a multiple of 32, to a row of the result."""
    for p in range(0, width, 4 * VECTOR):
        total = load(out, begin + p, 4)
        for k in range(count):
            row = load(rows, first + k * width + p, 4)
            total = multiply_add(spread(weights, at + k * step, 4), row, total)
        store(out, begin + p, total)


@kernel(forceinline=True)
def _pad(size):
    """Return the least multiple of 32 that is not smaller."""
    return -(-size // (4 * VECTOR)) * 4 * VECTOR


@kernel(forceinline=True)
def _zeros(size):
    array = padded_size(size)
    array[:] = 0.0
    return array


@kernel
def extend_products(
    products,  # float64 [segment, size, size]: of the other columns, of the own ones, and of the error
    directions,  # float64 [dependent, other and segment and own]: negative combinations
    own_rows,  # out, float64 [segment, own, shared + own + 1]: products of the own columns with all columns
    total,  # out, float64 [shared, shared + 1]: upper half of those of the shared ones, and with the error
):
    """Compute the products of all columns; the dependent columns are the last ones of the shared columns."""
    segments, own, size = len(products), own_rows.shape[1], products.shape[1]
    count, others, shared = len(directions), size - own - 1, len(total)
    wide, narrow, owned = _pad(others + 1), _pad(count), segments * own
    combinations, sums = _zeros((others + owned) * narrow), _zeros(others * wide)
    of_own, own_dependent = _zeros(owned * wide), _zeros(owned * narrow)
    for k in range(count):
        for a in range(others + owned):
            combinations[a * narrow + k] = -directions[k, a]
    for segment in range(segments):
        for a in range(others):
            for b in range(others):
                sums[a * wide + b] += products[segment, a, b]
            sums[a * wide + others] += products[segment, a, size - 1]
        for i in range(own):
            row, at = products[segment, others + i], segment * own + i
            of_own[at * wide : at * wide + others] = row[:others]
            of_own[at * wide + others] = row[size - 1]
            first, to = (others + segment * own) * narrow, at * narrow
            _add_rows(row, 0, 1, combinations, 0, others, narrow, own_dependent, to)
            _add_rows(row, others, 1, combinations, first, own, narrow, own_dependent, to)
            own_rows[segment, i, :others] = row[:others]
            own_rows[segment, i, others:shared] = own_dependent[to : to + count]
            own_rows[segment, i, shared:] = row[others:]
    for a in range(others):
        total[a, :others] = sums[a * wide : a * wide + others]
        total[a, shared] = sums[a * wide + others]
    cross, last = padded_size(wide), padded_size(narrow)
    for k in range(count):
        cross[:], last[:] = 0.0, 0.0
        _add_rows(combinations, k, narrow, sums, 0, others, wide, cross, 0)
        _add_rows(combinations, others * narrow + k, narrow, of_own, 0, owned, wide, cross, 0)
        _add_rows(cross, 0, 1, combinations, 0, others, narrow, last, 0)
        _add_rows(own_dependent, k, narrow, combinations, others * narrow, owned, narrow, last, 0)
        for a in range(others):
            total[a, others + k] = cross[a]
        total[others + k, :others] = 0.0
        total[others + k, others:shared] = last[:count]
        total[others + k, shared] = cross[others]
