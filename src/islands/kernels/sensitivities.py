"""Sensitivities of a simulation: derivatives of the simulated output with respect to the parameters.

The derivative of the model equation ``y(k) = sum_i theta_i x_i(k)`` along a direction d of the parameters is
a linear recursion (Ljung 1999, section 10.3) ::

    s(k) = sum_i d_i x_i(k) + sum_l a_l(k) s(k-l),    a_l(k) = sum_i theta_i dx_i(k)/dy(k-l)

All directions share the regressors and the slopes ``a_l``, so that many of them cost little more than one
simulation. Rows, lanes and blocks are those of `islands.kernels.simulate`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import execute, multiply_factors
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, address, broadcast, multiply, padded_size, read, write
from islands.kernels.simulate import MIDDLE, NARROW
from islands.kernels.simulation_block import (
    CHUNK,
    Chunk,
    allocate_workspace,
    get_place,
    move_history,
    open_block,
    place_operands,
)

#: Row widths in lanes for which the kernel is compiled. The sensitivities along all directions share the
#: overhead of a row, so that wider rows save nothing.
WIDTHS = (VECTOR * NARROW, VECTOR * MIDDLE)


class Slopes(NamedTuple):
    """Derivatives of the right side of a model equation with respect to past outputs.

    Attributes
    ----------
    weights : ndarray of float64, shape (products,)
        Weights of the products, which are the terms of the program after the regressors.
    lags : ndarray of int64, shape (lags,)
        Lags of the outputs, ascending.
    ends : ndarray of int64, shape (lags,)
        Product after the last one of the lag.
    """

    weights: NDArray[np.float64]
    lags: NDArray[np.int64]
    ends: NDArray[np.int64]


class SparseDirections(NamedTuple):
    """Directions in the space of the parameters, without their zeros.

    Attributes
    ----------
    terms : ndarray of int64, shape (entries,)
    values : ndarray of float64, shape (entries,)
    ends : ndarray of int64, shape (directions,)
        Entry after the last one of the direction.
    """

    terms: NDArray[np.int64]
    values: NDArray[np.float64]
    ends: NDArray[np.int64]


@kernel
def compute_sensitivities(
    program,  # terms: the regressors, then the products of the slopes
    theta,  # float64 [term]
    slopes,
    directions,
    layout,  # with rows of one of `WIDTHS`
    place,  # int64 [lane of all blocks]: place of the interval's first prediction in a row of ``found``
    found,  # out, float64 [direction, prediction]
):
    """Compute the derivatives of all predictions along all directions."""
    # There is one function per width, so that the compiler knows the number of lanes of a row.
    if layout.width == VECTOR * MIDDLE:
        _middle(program, theta, slopes, directions, layout, place, found)
    else:
        _narrow(program, theta, slopes, directions, layout, place, found)


def _make_computation(count):
    """Make the computation with rows of ``count`` vectors."""
    width = VECTOR * count

    @kernel
    def run(program, theta, slopes, directions, layout, place, found):
        lags, workspace = slopes.lags, allocate_workspace(program, layout.warm_up, count)
        rows, predictions, flat = found.shape[0], found.shape[1], found.reshape(-1)
        regressors = padded_size(theta.size * width)
        feedback = padded_size(max(1, lags.size) * width)
        # A ring of the last sensitivities.
        depth = lags[-1] if lags.size > 0 else 1
        ring, behind = padded_size(depth * rows * width), np.empty(lags.size, np.int64)
        unused = np.empty(layout.start.size, np.int64)
        lane = 0
        for block in range(layout.block_offset.size):
            lanes, steps = layout.block_lanes[block], layout.length[lane]
            open_block(workspace, layout, block, lane, unused, count)
            ring[:] = 0.0  # the measured outputs do not depend on the parameters
            active = lanes
            for begin in range(0, steps, CHUNK):
                chunk = Chunk(lane, lanes, begin, min(CHUNK, steps - begin))
                sample = layout.block_offset[block] + (layout.warm_up + begin) * layout.row_stride
                place_operands(program, workspace, layout, sample, count)
                prediction = address(workspace.arena, workspace.predictions)
                for step in range(begin, begin + chunk.steps):
                    while layout.length[lane + active - 1] <= step:
                        active -= 1
                    _simulate_step(program, theta, slopes, workspace, prediction, regressors, feedback, count)
                    now = step % depth
                    for index in range(lags.size):
                        before = now - lags[index]
                        before += depth if before < 0 else 0
                        behind[index] = address(ring, before * rows * width)
                    target = address(ring, now * rows * width)
                    _differentiate_step(directions, regressors, feedback, behind, target, count)
                    for row in range(rows):
                        at, first = row * predictions + step, (now * rows + row) * width
                        for index in range(active):
                            flat[at + place[lane + index]] = ring[first + index]
                    prediction += 8 * width
                move_history(workspace, layout, chunk, count)
            lane += lanes

    return run


_narrow = _make_computation(NARROW)
_middle = _make_computation(MIDDLE)


@kernel(forceinline=True, _nrt=False, constants=("count",))
def _simulate_step(program, theta, slopes, workspace, prediction, regressors, feedback, count):
    """Write a row of the prediction, of each regressor and of the slope for each lag; advance the places."""
    places, strides, targets = workspace.places, workspace.strides, workspace.targets
    code, addresses, factors, degree = program.code, program.addresses, program.factors, program.degree
    size = 8 * VECTOR * count
    for index in range(code.shape[0]):
        first, second = get_place(places, code[index, 2]), get_place(places, code[index, 3])
        execute(code[index, 0], targets[index], first, second, addresses[index], count, 1)
    y, at = broadcast(0.0, count), address(regressors, 0)
    for term in range(theta.size):
        a, b = places[factors[term, 0]], places[factors[term, 1]]
        c, d = places[factors[term, 2]], places[factors[term, 3]]
        product = multiply_factors(a, b, c, d, degree[term], count)
        write(at + term * size, product)
        y = add(y, multiply(broadcast(theta[term], count), product))
    write(prediction, y)
    at, done = address(feedback, 0), 0
    for lag in range(slopes.lags.size):
        slope = broadcast(0.0, count)
        while done < slopes.ends[lag]:
            term = theta.size + done
            a, b = places[factors[term, 0]], places[factors[term, 1]]
            c, d = places[factors[term, 2]], places[factors[term, 3]]
            product = multiply_factors(a, b, c, d, degree[term], count)
            slope = add(slope, multiply(broadcast(slopes.weights[done], count), product))
            done += 1
        write(at + lag * size, slope)
    for index in range(places.size):
        places[index] += strides[index]


@kernel(forceinline=True, _nrt=False, constants=("count",))
def _differentiate_step(directions, regressors, feedback, behind, target, count):
    """Write a row of the sensitivity along every direction."""
    size, entry = 8 * VECTOR * count, 0
    for row in range(directions.ends.size):
        s = broadcast(0.0, count)
        while entry < directions.ends[row]:
            x = read(address(regressors, 0) + directions.terms[entry] * size, count)
            s = add(s, multiply(broadcast(directions.values[entry], count), x))
            entry += 1
        for lag in range(behind.size):
            slope = read(address(feedback, 0) + lag * size, count)
            s = add(s, multiply(slope, read(behind[lag] + row * size, count)))
        write(target + row * size, s)
