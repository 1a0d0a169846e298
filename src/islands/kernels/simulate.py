"""One kernel for one-step-ahead prediction, multiple shooting and free run.

The record is cut into intervals; each starts from measured values and runs free. An interval is a *lane*; a
block is a row of lanes that are simulated together, so that one instruction of the program works on a whole
row (layout ``[block][time][lane]``). Intervals of one sample are one-step-ahead prediction, a single interval
is the free run.

A row is always computed whole. Lanes behind the block's last one repeat its first, and a lane that has ended
runs on; what they yield is never counted.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import TEMPORARY, execute, multiply_factors
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import (
    VECTOR,
    add,
    address,
    any_outside,
    broadcast,
    load,
    multiply,
    padded_size,
    read,
    subtract,
    write,
)

#: Steps that are simulated before the history is moved and the bound is checked.
CHUNK = 64

#: Vectors of a row that the kernel is compiled for: a single lane, a short record, and as many as keep the
#: history of a model inside the first-level cache.
NARROW, MIDDLE, WIDE = 1, 3, 13

#: Lanes of those rows.
WIDTHS = (VECTOR * NARROW, VECTOR * MIDDLE, VECTOR * WIDE)

#: How a simulation ended: after its last step, in a divergence, or beyond the error that it was allowed.
COMPLETE, DIVERGED, BEYOND = 0, 1, 2

#: A sum in another order may differ from the written one by its rounding, and nothing may be given up for
#: that.
_ROUNDING = 1.0 + 1e-9


class Layout(NamedTuple):
    """A record, cut into intervals and laid out in blocks of lanes.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, flat)
        Channel 0 is the measured output, then come the inputs. A row may be read behind the last sample.
    block_offset : ndarray of int64, shape (block,)
        Where in a channel the first warm-up row of the block stands.
    block_lanes : ndarray of int64, shape (block,)
        Lanes of the block.
    row_stride : int
        Distance between two rows (two times) of a block.
    start : ndarray of int64, shape (lane of all blocks,)
        Sample of the interval's first prediction.
    length : ndarray of int64, shape (lane of all blocks,)
        Samples of the interval; not increasing within a block.
    width : int
        Lanes of a row, one of `WIDTHS`.
    warm_up : int
        Rows before the first predicted one.
    largest : float
        The largest size of a measured output.
    """

    signals: NDArray[np.float64]
    block_offset: NDArray[np.int64]
    block_lanes: NDArray[np.int64]
    row_stride: int
    start: NDArray[np.int64]
    length: NDArray[np.int64]
    width: int
    warm_up: int
    largest: float


@kernel
def simulate(
    program,
    theta,  # float64 [term]
    layout,
    bound,  # a larger absolute prediction is a divergence
    allowed,  # stop where the sum of all squared errors is larger
    patient,  # False: stop at the end of the first chunk in which an interval diverged
    squared_error,  # out, float64 [lane of all blocks]: sum over the interval, in the order of time
    diverged,  # out, int64 [lane of all blocks]: step at which the interval left the bound, or -1
    predicted,  # out, float64 [sample] in the record's order; size 0: not wanted
):
    """Simulate every interval from measured values, and tell how it ended; the caller sums over intervals."""
    # Functions of their own: in each, the lanes of a row are known to the compiler.
    if layout.width == VECTOR * WIDE:
        return _wide(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)
    if layout.width == VECTOR * MIDDLE:
        return _middle(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)
    return _narrow(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)


def _simulator(count):
    """Make the simulation of rows of ``count`` vectors."""
    width = VECTOR * count

    @kernel
    def run(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted):
        signals, warm_up, apart = layout.signals.reshape(-1), layout.warm_up, 8 * layout.row_stride
        start, length = layout.start, layout.length
        code, addresses = program.code, program.addresses
        operands, factors, degree = program.operands, program.factors, program.degree
        flat = layout.signals.shape[1]
        # The predictions, the temporaries, and last the squared errors of a block.
        arena = padded_size((warm_up + CHUNK + program.temporaries + 1) * width)
        predictions, squares = warm_up * width, arena.size - width
        temporaries = (warm_up + CHUNK) * width
        place, stride = np.empty(operands.shape[0], np.int64), np.empty(operands.shape[0], np.int64)
        for index in range(program.constants.size):
            write(address(arena, temporaries + index * width), broadcast(program.constants[index], count))
        targets = np.empty(code.shape[0], np.int64)
        for index in range(code.shape[0]):
            targets[index] = address(arena, temporaries + code[index, 1] * width)

        # An error this small in every lane, and no prediction was outside the bound. A square that vanishes
        # or overflows tells nothing.
        safe = (bound - layout.largest) ** 2 * 0.99 if bound > layout.largest else -1.0
        if not 1e-290 < safe < 1e300:
            safe = -1.0
        ending, error_before, lane_base = COMPLETE, 0.0, 0
        for block in range(layout.block_offset.size):
            lanes = layout.block_lanes[block]
            offset = layout.block_offset[block]
            write(address(arena, squares), broadcast(0.0, count))
            for lane in range(lane_base, lane_base + lanes):
                diverged[lane] = -1
            for step in range(warm_up):
                row = read(address(signals, offset) + step * apart, count)
                write(address(arena, step * width), row)
            steps = length[lane_base]
            active = lanes
            done = 0
            while done < steps:
                chunk = min(CHUNK, steps - done)
                sample = offset + (warm_up + done) * layout.row_stride
                for index in range(place.size):
                    channel, lag = operands[index]
                    if channel == TEMPORARY:
                        place[index], stride[index] = address(arena, temporaries + lag * width), 0
                    elif channel == 0:
                        place[index], stride[index] = address(arena, predictions - lag * width), 8 * width
                    else:
                        place[index], stride[index] = (
                            address(signals, channel * flat + sample) - lag * apart,
                            apart,
                        )
                measured, prediction = address(signals, sample), address(arena, predictions)
                for step in range(done, done + chunk):
                    while length[lane_base + active - 1] <= step:
                        active -= 1
                        squared_error[lane_base + active] = arena[squares + active]
                    for index in range(code.shape[0]):
                        first, second = place[code[index, 2]], place[code[index, 3]]
                        execute(code[index, 0], targets[index], first, second, addresses[index], count, 1)
                    # The terms are added in their order.
                    y = broadcast(0.0, count)
                    for term in range(theta.size):
                        a, b = place[factors[term, 0]], place[factors[term, 1]]
                        c, d = place[factors[term, 2]], place[factors[term, 3]]
                        product = multiply_factors(a, b, c, d, degree[term], count)
                        y = add(y, multiply(broadcast(theta[term], count), product))
                    write(prediction, y)
                    error = subtract(y, read(measured, count))
                    square = add(read(address(arena, squares), count), multiply(error, error))
                    write(address(arena, squares), square)
                    for index in range(place.size):
                        place[index] += stride[index]
                    prediction += 8 * width
                    measured += apart
                if any_outside(load(arena, squares, count), safe) and _find_divergence(
                    arena, predictions, width, lane_base, lanes, length, done, chunk, bound, diverged
                ):
                    ending = DIVERGED
                    if not patient:
                        return ending
                if predicted.size > 0:
                    _scatter(
                        arena, predictions, width, lane_base, lanes, start, length, done, chunk, predicted
                    )
                done += chunk
                if done < steps:
                    if error_before + _running_error(arena, squares, active) > allowed * _ROUNDING:
                        return BEYOND
                    for step in range(warm_up):
                        row = load(arena, (step + chunk) * width, count)
                        write(address(arena, step * width), row)
            for lane in range(active):
                squared_error[lane_base + lane] = arena[squares + lane]
            for lane in range(lanes):
                error_before += squared_error[lane_base + lane]
            if error_before > allowed * _ROUNDING:
                return BEYOND
            lane_base += lanes
        return ending

    return run


_narrow, _middle, _wide = _simulator(NARROW), _simulator(MIDDLE), _simulator(WIDE)


@kernel
def _running_error(arena, squares, active):
    total = 0.0
    for lane in range(active):
        total += arena[squares + lane]
    return total


@kernel
def _find_divergence(arena, predictions, width, lane_base, lanes, length, done, chunk, bound, diverged):
    """Note where lanes of the block left the bound in this chunk; tell whether one has, now or before."""
    found = False
    for lane in range(lanes):
        for step in range(min(chunk, length[lane_base + lane] - done)):
            value = arena[predictions + step * width + lane]
            if diverged[lane_base + lane] < 0 and not (abs(value) <= bound):
                diverged[lane_base + lane] = done + step
        found |= diverged[lane_base + lane] >= 0
    return found


@kernel
def _scatter(arena, predictions, width, lane_base, lanes, start, length, done, chunk, predicted):
    for lane in range(lanes):
        for step in range(min(chunk, length[lane_base + lane] - done)):
            predicted[start[lane_base + lane] + done + step] = arena[predictions + step * width + lane]
