"""Columns of the regressor matrix: the same program as in a simulation, over measured rows alone.

Here a lane is a sample: the lags of a signal are stretches of one row, so nothing is gathered.
"""

import numpy as np
from numba import njit

from islands.kernels.machine import execute
from islands.kernels.sums import FOLD


@njit(nogil=True, cache=True, error_model="numpy")
def columns(
    program,
    signals,  # float64 [channel, sample]: channel 0 is the output, then the inputs
    first,  # int64 [segment]: sample of the segment's first row
    rows,  # int64 [segment]: rows of the segment
    warm_up,  # samples before each first row that may be read
    out,  # out, float64 [term, row of all segments]
):
    """Evaluate every term on every row."""
    arena, place = arena_for(program, signals.shape[0], warm_up)
    row = 0
    for segment in range(first.size):
        done = 0
        while done < rows[segment]:
            lanes = min(FOLD, rows[segment] - done)
            evaluate(program, signals, first[segment] + done, lanes, warm_up, arena, place, out, row)
            done += lanes
            row += lanes


@njit(nogil=True, cache=True, error_model="numpy")
def arena_for(program, channels, warm_up):
    """Return the arena, its constants filled in, and the offset of every operand in it."""
    history = warm_up + FOLD
    home = channels * history
    arena = np.empty(home + program.temporaries * FOLD)
    for index in range(program.constants.size):
        for lane in range(FOLD):
            arena[home + index * FOLD + lane] = program.constants[index]
    place = np.empty(program.operands.shape[0], np.uint64)
    for index in range(place.size):
        channel, lag = program.operands[index]
        place[index] = home + lag * FOLD if channel < 0 else channel * history + warm_up - lag
    return arena, place


@njit(nogil=True, cache=True, error_model="numpy")
def evaluate(
    program,
    signals,
    sample,  # the first row's sample
    lanes,  # rows to evaluate, at most FOLD
    warm_up,
    arena,
    place,  # as `arena_for` made them
    out,  # out, float64 [term, ...]
    column,  # where in `out` the first row goes
):
    """Evaluate every term on a stretch of rows of one segment."""
    count = np.uint64(lanes)
    history = np.uint64(warm_up + FOLD)
    begin = np.uint64(sample - warm_up)
    for channel in range(signals.shape[0]):
        base = np.uint64(channel) * history
        for index in range(np.uint64(warm_up) + count):
            arena[base + index] = signals[channel, begin + index]
    first_temporary = np.uint64(arena.size - program.temporaries * FOLD)
    code = program.code
    for index in range(code.shape[0]):
        target = first_temporary + np.uint64(code[index, 1] * FOLD)
        first, second = place[code[index, 2]], place[code[index, 3]]
        execute(arena, code[index, 0], target, first, second, count, program.addresses[index])
    at = np.uint64(column)
    for term in range(program.degree.size):
        source = place[program.factors[term, 0]]
        for lane in range(count):
            out[term, at + lane] = arena[source + lane]
        for factor in range(1, program.degree[term]):
            source = place[program.factors[term, factor]]
            for lane in range(count):
                out[term, at + lane] *= arena[source + lane]
