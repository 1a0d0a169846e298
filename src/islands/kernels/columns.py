"""Columns of the regressor matrix: the same program as in a simulation, over measured rows alone.

Here a lane is a sample: the lags of a signal are stretches of one row, so nothing is gathered.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.compilation import kernel
from islands.kernels.lanes import VECTOR, address, multiply, read, room, write
from islands.kernels.machine import TEMPORARY, execute, multiply_factors
from islands.kernels.sums import CHUNK

#: A chunk of rows is worked through in this many strides of so many vectors.
_COUNT = 4
_STRIDES = CHUNK // (VECTOR * _COUNT)


class Rows(NamedTuple):
    """The rows of a record that estimate.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, sample)
        Channel 0 is the output, then come the inputs.
    first, rows : ndarray of int64, shape (segment,)
        Sample of a segment's first row, and how many rows it has.
    warm_up : int
        Samples before each first row that may be read.
    """

    signals: NDArray[np.float64]
    first: NDArray[np.int64]
    rows: NDArray[np.int64]
    warm_up: int


@kernel
def columns(
    program,
    rows,
    out,  # out, float64 [term, row of all segments]
):
    """Evaluate every term on every row."""
    arena, place = arena_for(program, rows)
    chunk = room(program.degree.size * CHUNK)
    row = 0
    for segment in range(rows.first.size):
        for done in range(0, rows.rows[segment], CHUNK):
            lanes = min(CHUNK, rows.rows[segment] - done)
            evaluate(program, rows, rows.first[segment] + done, lanes, arena, place, chunk)
            for term in range(program.degree.size):
                for lane in range(lanes):
                    out[term, row + lane] = chunk[term * CHUNK + lane]
            row += lanes


@kernel
def arena_for(program, rows):
    """Return room for the temporaries and for a stretch of the signals, and the addresses of the operands.

    Those of signals are filled in by `evaluate`.
    """
    stretch = rows.warm_up + CHUNK
    home = -(-rows.signals.shape[0] * stretch // VECTOR) * VECTOR  # temporaries begin at a line of the cache
    arena = room(home + program.temporaries * CHUNK)
    arena[:] = 0.0
    for index in range(program.constants.size):
        arena[home + index * CHUNK : home + (index + 1) * CHUNK] = program.constants[index]
    place = np.empty(program.operands.shape[0], np.int64)
    for index in range(place.size):
        if program.operands[index, 0] == TEMPORARY:
            place[index] = address(arena, home + program.operands[index, 1] * CHUNK)
    return arena, place


@kernel(forceinline=True, _nrt=False)
def evaluate(
    program,
    rows,
    sample,  # the first row's sample
    lanes,  # rows to evaluate, at most 256
    arena,
    place,  # as `arena_for` made them
    chunk,  # out, float64 [term * 256]: zero behind the last row
):
    """Evaluate every term on a stretch of rows of one segment."""
    # Fields are taken out of their tuples once: each time costs as much as a row.
    signals, warm_up = rows.signals, rows.warm_up
    code, addresses, operands = program.code, program.addresses, program.operands
    factors, degree = program.factors, program.degree
    samples = signals.shape[1]
    source, stride, base = address(signals, 0), samples, sample
    if lanes < CHUNK:
        # Rows are computed whole, and behind the last one the record may end: read a copy.
        stretch = warm_up + CHUNK
        for channel in range(signals.shape[0]):
            for index in range(warm_up + lanes):
                arena[channel * stretch + index] = signals[channel, sample - warm_up + index]
        source, stride, base = address(arena, 0), stretch, warm_up
    for index in range(place.size):
        channel, lag = operands[index, 0], operands[index, 1]
        if channel != TEMPORARY:
            place[index] = source + 8 * (channel * stride + base - lag)
    first_temporary = address(arena, arena.size - program.temporaries * CHUNK)
    for index in range(code.shape[0]):
        target = first_temporary + 8 * CHUNK * code[index, 1]
        first, second = place[code[index, 2]], place[code[index, 3]]
        execute(code[index, 0], target, first, second, addresses[index], _COUNT, _STRIDES)
    for term in range(degree.size):
        target = address(chunk, term * CHUNK)
        a, b = place[factors[term, 0]], place[factors[term, 1]]
        c, d = place[factors[term, 2]], place[factors[term, 3]]
        if degree[term] == 1:
            for at in range(0, 8 * CHUNK, 8 * VECTOR * _COUNT):
                write(target + at, read(a + at, _COUNT))
        elif degree[term] == 2:
            for at in range(0, 8 * CHUNK, 8 * VECTOR * _COUNT):
                write(target + at, multiply(read(a + at, _COUNT), read(b + at, _COUNT)))
        else:
            for at in range(0, 8 * CHUNK, 8 * VECTOR * _COUNT):
                write(target + at, multiply_factors(a + at, b + at, c + at, d + at, degree[term], _COUNT))
        for lane in range(lanes, CHUNK):
            chunk[term * CHUNK + lane] = 0.0
