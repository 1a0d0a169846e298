"""One kernel for one-step-ahead prediction, multiple shooting and free run.

The record is cut into intervals; each starts from measured values and runs free. An interval is a *lane*; a
block is a row of lanes that are simulated together, so that one instruction of the program works on a whole
row (layout ``[block][time][lane]``). Intervals of one sample are one-step-ahead prediction, a single interval
is the free run.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from islands.kernels.machine import execute

#: Steps that are simulated before the history is moved and the bound is checked.
CHUNK = 64


class Layout(NamedTuple):
    """A record, cut into intervals and laid out in blocks of lanes.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, flat)
        Channel 0 is the measured output, then come the inputs.
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
        The most lanes of a block.
    warm_up : int
        Rows before the first predicted one.
    """

    signals: NDArray[np.float64]
    block_offset: NDArray[np.int64]
    block_lanes: NDArray[np.int64]
    row_stride: int
    start: NDArray[np.int64]
    length: NDArray[np.int64]
    width: int
    warm_up: int


@njit(nogil=True, cache=True, error_model="numpy")
def simulate(
    program,
    theta,  # float64 [term]
    layout,
    bound,  # a larger absolute prediction is a divergence
    patient,  # False: stop at the end of the first chunk in which an interval diverged
    squared_error,  # out, float64 [lane of all blocks]: sum over the interval, in the order of time
    diverged,  # out, int64 [lane of all blocks]: step at which the interval left the bound, or -1
    predicted,  # out, float64 [sample] in the record's order; size 0: not wanted
):
    """Simulate every interval from measured values; the caller sums over intervals."""
    signals, warm_up, width, row_stride = layout.signals, layout.warm_up, layout.width, layout.row_stride
    start, length = layout.start, layout.length
    code, addresses = program.code, program.addresses
    channels = signals.shape[0]
    row = np.uint64(width)
    history = warm_up + CHUNK
    arena = np.empty((channels * history + program.temporaries) * width)
    first_temporary = np.uint64(channels * history * width)
    home, stride = _operand_rows(program, first_temporary, history, warm_up, row)
    place = np.empty_like(home)
    for index in range(program.constants.size):
        at = first_temporary + np.uint64(index) * row
        for lane in range(row):
            arena[at + lane] = program.constants[index]

    y_home = np.uint64(warm_up) * row
    lane_base = 0
    for block in range(layout.block_offset.size):
        lanes = np.uint64(layout.block_lanes[block])
        offset = layout.block_offset[block]
        for lane in range(lane_base, lane_base + layout.block_lanes[block]):
            squared_error[lane] = 0.0
            diverged[lane] = -1
        for channel in range(channels):
            target = np.uint64(channel * history) * row
            _copy_rows(signals, channel, offset, row_stride, arena, target, row, lanes, warm_up)
        steps = length[lane_base]
        active = lanes
        done = 0
        while done < steps:
            chunk = min(CHUNK, steps - done)
            measured = offset + (warm_up + done) * row_stride
            for channel in range(1, channels):
                target = np.uint64(channel * history + warm_up) * row
                _copy_rows(signals, channel, measured, row_stride, arena, target, row, lanes, chunk)
            place[:] = home
            y_row = y_home
            outside = 0
            for step in range(done, done + chunk):
                while length[lane_base + np.int64(active) - 1] <= step:
                    active -= np.uint64(1)
                for index in range(code.shape[0]):
                    target = first_temporary + np.uint64(code[index, 1]) * row
                    first, second = place[code[index, 2]], place[code[index, 3]]
                    execute(arena, code[index, 0], target, first, second, active, addresses[index])
                _sum_terms(arena, program.factors, program.degree, theta, place, y_row, active)
                outside += _add_squared_error(
                    arena, y_row, signals, measured, squared_error, lane_base, active, bound
                )
                for index in range(place.size):
                    place[index] += stride[index]
                y_row += row
                measured += row_stride
            if outside > 0:
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
        lane_base += layout.block_lanes[block]


@njit(nogil=True, cache=True, error_model="numpy")
def _operand_rows(program, first_temporary, history, warm_up, row):
    """Return every operand's offset at the first step, and by how much it moves with a step."""
    count = program.operands.shape[0]
    home = np.empty(count, np.uint64)
    stride = np.empty(count, np.uint64)
    for index in range(count):
        channel, lag = program.operands[index]
        if channel < 0:
            home[index] = first_temporary + np.uint64(lag) * row
            stride[index] = np.uint64(0)
        else:
            home[index] = np.uint64(channel * history + warm_up - lag) * row
            stride[index] = row
    return home, stride


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
