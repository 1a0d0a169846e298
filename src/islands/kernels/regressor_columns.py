"""Columns of the regressor matrix: the program of a simulation, evaluated on measured rows only.

A segment is cut into 32 stretches of equal length, one lane each. A lag is then an earlier row, and every
vector starts at a cache line. In the order of the record, most lagged vectors would cross two cache lines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.interpreter import TEMPORARY, execute, multiply_factors
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, address, padded_size, write
from islands.kernels.summation import CHUNK

#: Lanes per time.
LANES = 32

#: Times per chunk.
TIMES = CHUNK // LANES

#: Vectors that one instruction processes at a time.
_COUNT = 4

#: Repetitions that an instruction needs for a chunk.
_STRIDES = CHUNK // (VECTOR * _COUNT)


class Rows(NamedTuple):
    """Rows of a record that are used for the estimation, in chunks of eight times 32 lanes.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, flat)
        Channel 0 is the output; the inputs follow. Memory layout [time][lane], the warm-up first, one segment
        after the other.
    offset : ndarray of int64, shape (chunk,)
        Offset within a channel of the chunk's first time.
    lanes : ndarray of int64, shape (chunk, 8)
        Number of lanes of each time that are rows; the remaining lanes are padding.
    row : ndarray of int64, shape (chunk, 8)
        Row of the first lane, counted over all segments.
    apart : ndarray of int64, shape (chunk,)
        Distance in rows between neighbouring lanes.
    count : int
        Number of rows of all segments.
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
    arena, place = allocate_arena(program)
    chunk = padded_size(program.degree.size * CHUNK)
    for index in range(rows.offset.size):
        evaluate(program, rows, index, arena, place, chunk)
        for term in range(program.degree.size):
            for time in range(TIMES):
                at = term * CHUNK + time * LANES
                for lane in range(rows.lanes[index, time]):
                    out[term, rows.row[index, time] + lane * rows.apart[index]] = chunk[at + lane]


@kernel
def allocate_arena(program):
    """Return memory for the temporaries, and the addresses of the operands.

    `evaluate` fills in the addresses of the signals.
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
    index,  # index of the chunk
    arena,
    place,  # as returned by `allocate_arena`
    chunk,  # out, float64 [term * 256]: zero in lanes that are no rows
):
    """Evaluate every term on a chunk of rows."""
    # Fields are read from their tuples once: each access costs as much as a row.
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
        if lanes[index, TIMES - 1] < LANES:  # the number of rows does not increase with the time
            for time in range(TIMES):
                for lane in range(lanes[index, time], LANES):
                    chunk[term * CHUNK + time * LANES + lane] = 0.0
