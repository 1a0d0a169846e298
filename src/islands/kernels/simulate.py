"""One kernel for one-step-ahead prediction, multiple shooting and free run.

The record is cut into intervals; each starts from measured values and runs free. An interval is a *lane*; a
block is a row of lanes that are simulated together, so that one instruction of the program works on a whole
row (layout ``[block][time][lane]``). Intervals of one sample are one-step-ahead prediction, a single interval
is the free run.
"""

import numpy as np
from numba import njit

from islands.kernels.machine import execute

#: Steps that are simulated before the history is moved and the bound is checked.
CHUNK = 64


@njit(nogil=True, cache=True, error_model="numpy")
def simulate(
    signals,  # float64 [channel][flat]: channel 0 is the measured output, then the inputs
    block_offset,  # int64 [block]: where the block's first warm-up row starts in a channel
    block_lanes,  # int64 [block]
    row_stride,  # distance between two rows (two times) of a block in a channel
    start,  # int64 [lane of all blocks]: sample at which the interval's first prediction stands
    length,  # int64 [lane of all blocks]: samples of the interval, not increasing within a block
    width,  # lanes for which the arena has room
    warm_up,  # rows before the first predicted one
    code,  # int64 [instruction, 4]: operation, target temporary, first operand, second operand
    addresses,  # int64 [instruction]: row function of a CALL
    operands,  # int64 [operand, 2]: channel and lag, or -1 and the index of a temporary
    constants,  # float64 [constant]: the first temporaries hold these
    temporaries,  # number of temporary rows
    factors,  # int64 [term, 4]: operands whose product is the term
    degree,  # int64 [term]: how many of them there are
    theta,  # float64 [term]
    bound,  # a larger absolute prediction is a divergence
    patient,  # False: stop at the end of the first chunk in which an interval diverged
    squared_error,  # out, float64 [lane of all blocks]: sum over the interval
    diverged,  # out, int64 [lane of all blocks]: step at which the interval left the bound, or -1
    predicted,  # out, float64 [sample] in the record's order; size 0: not wanted
):
    """Simulate every interval; see the comments at the arguments for shapes.

    Each interval's squared error is summed in the order of time. The caller sums over intervals.
    """
    channels = signals.shape[0]
    row = np.uint64(width)
    history = warm_up + CHUNK
    arena = np.empty((channels * history + temporaries) * width)
    first_temporary = np.uint64(channels * history * width)
    for index in range(constants.size):
        at = first_temporary + np.uint64(index) * row
        for lane in range(row):
            arena[at + lane] = constants[index]

    n_operands = operands.shape[0]
    home = np.empty(n_operands, np.uint64)
    stride = np.empty(n_operands, np.uint64)
    for index in range(n_operands):
        channel, lag = operands[index]
        if channel < 0:
            home[index] = first_temporary + np.uint64(lag) * row
            stride[index] = np.uint64(0)
        else:
            home[index] = np.uint64(channel * history + warm_up - lag) * row
            stride[index] = row
    place = np.empty(n_operands, np.uint64)

    y_home = np.uint64(warm_up) * row
    lane_base = 0
    for block in range(block_offset.size):
        lanes = np.uint64(block_lanes[block])
        offset = block_offset[block]
        for lane in range(lane_base, lane_base + block_lanes[block]):
            squared_error[lane] = 0.0
            diverged[lane] = -1
        steps = length[lane_base]
        for channel in range(channels):
            _copy_rows(
                signals,
                channel,
                offset,
                row_stride,
                arena,
                np.uint64(channel * history) * row,
                row,
                lanes,
                warm_up,
            )
        done = 0
        active = lanes
        while done < steps:
            chunk = min(CHUNK, steps - done)
            for channel in range(1, channels):
                _copy_rows(
                    signals,
                    channel,
                    offset + (warm_up + done) * row_stride,
                    row_stride,
                    arena,
                    np.uint64(channel * history + warm_up) * row,
                    row,
                    lanes,
                    chunk,
                )
            for index in range(n_operands):
                place[index] = home[index]
            left_bound = 0
            y_row = y_home
            measured = offset + (warm_up + done) * row_stride
            for step in range(done, done + chunk):
                while active > 0 and length[lane_base + np.int64(active) - 1] <= step:
                    active -= np.uint64(1)
                for index in range(code.shape[0]):
                    execute(
                        arena,
                        code[index, 0],
                        first_temporary + np.uint64(code[index, 1]) * row,
                        place[code[index, 2]],
                        place[code[index, 3]],
                        active,
                        addresses[index],
                    )
                _sum_terms(arena, factors, degree, theta, place, y_row, active)
                left_bound += _add_squared_error(
                    arena, y_row, signals, measured, squared_error, lane_base, active, bound
                )
                for index in range(n_operands):
                    place[index] += stride[index]
                y_row += row
                measured += row_stride
            if left_bound > 0:
                _find_divergence(arena, y_home, row, lane_base, lanes, length, done, chunk, bound, diverged)
                if not patient:
                    return
            if predicted.size > 0:
                _scatter(arena, y_home, row, lane_base, lanes, start, length, done, chunk, predicted)
            for channel in range(channels):
                base = np.uint64(channel * history) * row
                for index in range(np.uint64(warm_up) * row):
                    arena[base + index] = arena[base + index + np.uint64(chunk) * row]
            done += chunk
        lane_base += block_lanes[block]


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _copy_rows(signals, channel, offset, row_stride, arena, target, row, lanes, rows):
    for index in range(rows):
        source = np.uint64(offset + index * row_stride)
        for lane in range(lanes):
            arena[target + lane] = signals[channel, source + lane]
        target += row


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _sum_terms(arena, factors, degree, theta, place, y_row, active):
    """``y = theta_1 psi_1 + theta_2 psi_2 + ...`` in the order of the terms, each product from the left."""
    for lane in range(active):
        arena[y_row + lane] = 0.0
    for term in range(theta.size):
        weight = theta[term]
        a = place[factors[term, 0]]
        if degree[term] == 1:
            for lane in range(active):
                arena[y_row + lane] += weight * arena[a + lane]
            continue
        b = place[factors[term, 1]]
        if degree[term] == 2:
            for lane in range(active):
                arena[y_row + lane] += weight * (arena[a + lane] * arena[b + lane])
            continue
        c = place[factors[term, 2]]
        if degree[term] == 3:
            for lane in range(active):
                arena[y_row + lane] += weight * (arena[a + lane] * arena[b + lane] * arena[c + lane])
            continue
        d = place[factors[term, 3]]
        for lane in range(active):
            arena[y_row + lane] += weight * (
                arena[a + lane] * arena[b + lane] * arena[c + lane] * arena[d + lane]
            )


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _add_squared_error(arena, y_row, signals, measured, squared_error, lane_base, active, bound):
    """Add the row's squared errors; return how many lanes left the bound (NaN counts as leaving)."""
    outside = 0
    source = np.uint64(measured)
    total = np.uint64(lane_base)
    for lane in range(active):
        value = arena[y_row + lane]
        error = value - signals[0, source + lane]
        squared_error[total + lane] += error * error
        outside += np.int64(not (abs(value) <= bound))
    return outside


@njit(nogil=True, cache=True, error_model="numpy")
def _find_divergence(arena, y_home, row, lane_base, lanes, length, done, chunk, bound, diverged):
    for lane in range(np.int64(lanes)):
        for step in range(min(chunk, length[lane_base + lane] - done)):
            value = arena[y_home + np.uint64(step) * row + np.uint64(lane)]
            if diverged[lane_base + lane] < 0 and not (abs(value) <= bound):
                diverged[lane_base + lane] = done + step


@njit(nogil=True, cache=True, error_model="numpy")
def _scatter(arena, y_home, row, lane_base, lanes, start, length, done, chunk, predicted):
    for lane in range(np.int64(lanes)):
        for step in range(min(chunk, length[lane_base + lane] - done)):
            predicted[start[lane_base + lane] + done + step] = arena[
                y_home + np.uint64(step) * row + np.uint64(lane)
            ]
