"""One kernel for one-step-ahead prediction, multiple shooting and free run.

The record is cut into intervals. Each interval starts from measured values and then runs free. Intervals of
one sample give one-step-ahead predictions; a single interval is the free run.

An interval is a *lane*. A *block* is a set of lanes that are simulated together, so that one instruction of
the program works on a whole *row*, the values of all lanes of the block at one time (memory layout
``[block][time][lane]``).

Every row is computed at its full width. If a block has fewer lanes than the row, the remaining lanes repeat
the block's first lane. A lane that has reached the end of its interval is computed further. The results of
both are ignored.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, any_outside, load
from islands.kernels.simulation_block import (
    CHUNK,
    Chunk,
    allocate_workspace,
    close_block,
    find_divergence,
    move_history,
    open_block,
    run_chunk,
    running_error,
    safe_error,
    scatter,
)

#: Vectors per row for a single lane.
NARROW = 1

#: Vectors per row for a short record.
MIDDLE = 3

#: Vectors per row for a long record: as many as keep the history of a model in the first-level cache.
WIDE = 13

#: Row widths in lanes for which the kernel is compiled.
WIDTHS = (VECTOR * NARROW, VECTOR * MIDDLE, VECTOR * WIDE)

#: Status of a simulation: every step was computed and no interval diverged.
COMPLETE = 0

#: Status of a simulation: an interval diverged.
DIVERGED = 1

#: Status of a simulation: stopped because the squared error exceeds the allowed one.
ABANDONED = 2

#: Tolerance of the check against the allowed error. A sum in another order may differ from the reported one
#: by its rounding; rounding alone must not abandon a model.
_ROUNDING = 1.0 + 1e-9


class Layout(NamedTuple):
    """A record that is cut into intervals and laid out in blocks of lanes.

    Attributes
    ----------
    signals : ndarray of float64, shape (channel, flat)
        Channel 0 is the measured output; the inputs follow. A row may extend beyond the last sample.
    block_offset : ndarray of int64, shape (block,)
        Offset within a channel of the first warm-up row of the block.
    block_lanes : ndarray of int64, shape (block,)
        Number of lanes of the block.
    row_stride : int
        Distance between two consecutive rows (times) of a block.
    start : ndarray of int64, shape (lane of all blocks,)
        Sample of the interval's first prediction.
    length : ndarray of int64, shape (lane of all blocks,)
        Number of samples of the interval; not increasing within a block.
    width : int
        Lanes per row, one of `WIDTHS`.
    warm_up : int
        Number of rows before the first predicted row.
    largest : float
        Largest absolute value of the measured output.
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
    allowed,  # stop as soon as the sum of all squared errors is larger
    patient,  # False: stop at the end of the first chunk in which an interval diverged
    squared_error,  # out, float64 [lane of all blocks]: sum over the interval, in the order of time
    diverged,  # out, int64 [lane of all blocks]: step at which the interval exceeded the bound, or -1
    predicted,  # out, float64 [sample] in the record's order; size 0: not computed
):
    """Simulate every interval from measured values and return the status; the caller sums over intervals."""
    # There is one function per width, so that the compiler knows the number of lanes of a row.
    if layout.width == VECTOR * WIDE:
        return _wide(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)
    if layout.width == VECTOR * MIDDLE:
        return _middle(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)
    return _narrow(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted)


def _make_simulator(count):
    """Make the simulation with rows of ``count`` vectors."""

    @kernel
    def run(program, theta, layout, bound, allowed, patient, squared_error, diverged, predicted):
        workspace = allocate_workspace(program, layout.warm_up, count)
        safe = safe_error(bound, layout.largest)
        status, error_before, lane = COMPLETE, 0.0, 0
        for block in range(layout.block_offset.size):
            lanes, steps = layout.block_lanes[block], layout.length[lane]
            open_block(workspace, layout, block, lane, diverged, count)
            active, begin = lanes, 0
            while begin < steps:
                chunk = Chunk(lane, lanes, begin, min(CHUNK, steps - begin))
                active = run_chunk(
                    program, theta, workspace, layout, block, chunk, active, squared_error, count
                )
                if any_outside(load(workspace.arena, workspace.squares, count), safe) and find_divergence(
                    workspace, layout, chunk, bound, diverged
                ):
                    status = DIVERGED
                    if not patient:
                        return status
                if predicted.size > 0:
                    scatter(workspace, layout, chunk, predicted)
                begin += chunk.steps
                if begin < steps:
                    if error_before + running_error(workspace, active) > allowed * _ROUNDING:
                        return ABANDONED
                    move_history(workspace, layout, chunk, count)
            error_before = close_block(workspace, lane, lanes, active, error_before, squared_error)
            if error_before > allowed * _ROUNDING:
                return ABANDONED
            lane += lanes
        return status

    return run


_narrow = _make_simulator(NARROW)
_middle = _make_simulator(MIDDLE)
_wide = _make_simulator(WIDE)
