"""Columns of the regressor matrix: the same program as in a simulation, over measured rows alone.

A recording is cut into 32 stretches of equal length that lie side by side, a lane each, so that a lag is an
earlier row and every vector begins at a line of the cache: read along the record, most lags would lie across
two lines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import TEMPORARY, execute, multiply_factors
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, address, padded_size, write
from islands.kernels.summation import CHUNK

#: Lanes of a row, and rows of a chunk.
LANES = 32
TIMES = CHUNK // LANES

#: A chunk of rows is worked through in this many strides of so many vectors.
_COUNT = 4
_STRIDES = CHUNK // (VECTOR * _COUNT)


class Rows(NamedTuple):
    """The rows of a record that estimate, in chunks of eight times 32 lanes.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, flat)
        Channel 0 is the output, then come the inputs: [time][lane], the warm-up first, one segment after the
        other.
    offset : ndarray of int64, shape (chunk,)
        Where in a channel the chunk's first time stands.
    lanes : ndarray of int64, shape (chunk, 8)
        How many lanes of every time are rows; what is behind them is not.
    row : ndarray of int64, shape (chunk, 8)
        The row of the first lane, counted through all segments.
    apart : ndarray of int64, shape (chunk,)
        How many rows the next lane is further.
    count : int
        Rows of all segments.
    """

    signals: NDArray[np.float64]
    offset: NDArray[np.int64]
    lanes: NDArray[np.int64]
    row: NDArray[np.int64]
    apart: NDArray[np.int64]
    count: int


@kernel
def columns(
    program,
    rows,
    out,  # out, float64 [term, row of all segments]
):
    """Evaluate every term on every row."""
    arena, place = arena_for(program)
    chunk = padded_size(program.degree.size * CHUNK)
    for index in range(rows.offset.size):
        evaluate(program, rows, index, arena, place, chunk)
        for term in range(program.degree.size):
            for time in range(TIMES):
                at = term * CHUNK + time * LANES
                for lane in range(rows.lanes[index, time]):
                    out[term, rows.row[index, time] + lane * rows.apart[index]] = chunk[at + lane]


@kernel
def arena_for(program):
    """Return room for the temporaries, and the addresses of the operands.

    Those of signals are filled in by `evaluate`.
    """
    arena = padded_size(program.temporaries * CHUNK)
    for index in range(program.constants.size):
        arena[index * CHUNK : (index + 1) * CHUNK] = program.constants[index]
    place = np.empty(program.operands.shape[0], np.int64)
    for index in range(place.size):
        if program.operands[index, 0] == TEMPORARY:
            place[index] = address(arena, program.operands[index, 1] * CHUNK)
    return arena, place


@kernel(forceinline=True, _nrt=False)
def evaluate(
    program,
    rows,
    index,  # of the chunk
    arena,
    place,  # as `arena_for` made them
    chunk,  # out, float64 [term * 256]: zero where there is no row
):
    """Evaluate every term on a chunk of rows."""
    # Fields are taken out of their tuples once: each time costs as much as a row.
    signals, offset, lanes = rows.signals, rows.offset, rows.lanes
    code, addresses, operands = program.code, program.addresses, program.operands
    factors, degree = program.factors, program.degree
    for operand in range(place.size):
        channel, lag = operands[operand, 0], operands[operand, 1]
        if channel != TEMPORARY:
            place[operand] = address(signals, channel * signals.shape[1] + offset[index] - lag * LANES)
    first_temporary = address(arena, 0)
    for step in range(code.shape[0]):
        target = first_temporary + 8 * CHUNK * code[step, 1]
        first, second = place[code[step, 2]], place[code[step, 3]]
        execute(code[step, 0], target, first, second, addresses[step], _COUNT, _STRIDES)
    for term in range(degree.size):
        target = address(chunk, term * CHUNK)
        a, b = place[factors[term, 0]], place[factors[term, 1]]
        c, d = place[factors[term, 2]], place[factors[term, 3]]
        for at in range(0, 8 * CHUNK, 8 * VECTOR * _COUNT):
            write(target + at, multiply_factors(a + at, b + at, c + at, d + at, degree[term], _COUNT))
        if lanes[index, TIMES - 1] < LANES:  # a later time has no more rows than an earlier one
            for time in range(TIMES):
                for lane in range(lanes[index, time], LANES):
                    chunk[term * CHUNK + time * LANES + lane] = 0.0
