"""Simulation of one block of lanes in chunks of steps: the parts of `simulate`.

A block is opened, simulated chunk by chunk and closed. `islands.kernels.simulate` defines lanes,
rows and blocks. The functions are inlined and do not count references, so that a short block costs no more
than its arithmetic.
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
    broadcast,
    load,
    multiply,
    padded_size,
    read,
    subtract,
    write,
)

#: Number of steps that are simulated before the history is moved and the divergence bound is checked.
CHUNK = 64


class Workspace(NamedTuple):
    """Memory that all blocks of one call share. Offsets are in the arena.

    Attributes
    ----------
    arena : ndarray of float64, shape (flat,)
        Rows: the history, the predictions of a chunk, the temporaries, the squared errors of the block.
    predictions : int
        Offset of the first prediction of the chunk.
    temporaries : int
        Offset of the first temporary.
    squares : int
        Offset of the squared errors.
    places : ndarray of int64, shape (operands,)
        Address of every operand at the current step.
    strides : ndarray of int64, shape (operands,)
        Distance in bytes between an operand's rows of two consecutive steps.
    targets : ndarray of int64, shape (instructions,)
        Address of the temporary that the instruction writes.
    """

    arena: NDArray[np.float64]
    predictions: int
    temporaries: int
    squares: int
    places: NDArray[np.int64]
    strides: NDArray[np.int64]
    targets: NDArray[np.int64]


class Chunk(NamedTuple):
    """Consecutive steps of one block.

    Attributes
    ----------
    lane : int
        First lane of the block, counted over all blocks.
    lanes : int
        Number of lanes of the block.
    begin : int
        First step of the chunk.
    steps : int
        Number of steps of the chunk.
    """

    lane: int
    lanes: int
    begin: int
    steps: int


@kernel(forceinline=True, constants=("count",))
def allocate_workspace(program, warm_up, count):
    """Allocate the workspace and write the constants into their temporaries."""
    width = VECTOR * count
    arena = padded_size((warm_up + CHUNK + program.temporaries + 1) * width)
    predictions, temporaries = warm_up * width, (warm_up + CHUNK) * width
    operands = program.operands.shape[0]
    places, strides = np.empty(operands, np.int64), np.empty(operands, np.int64)
    for index in range(program.constants.size):
        write(address(arena, temporaries + index * width), broadcast(program.constants[index], count))
    targets = np.empty(program.code.shape[0], np.int64)
    for index in range(targets.size):
        targets[index] = address(arena, temporaries + program.code[index, 1] * width)
    return Workspace(arena, predictions, temporaries, arena.size - width, places, strides, targets)


@kernel
def safe_error(bound, largest):
    """Return a squared error below which no lane can have diverged; -1 if there is none.

    A prediction outside the bound differs from every measured output by more than ``bound - largest``. A
    square that underflows or overflows allows no such conclusion.
    """
    safe = (bound - largest) ** 2 * 0.99 if bound > largest else -1.0
    return safe if 1e-290 < safe < 1e300 else -1.0


@kernel(forceinline=True, _nrt=False, constants=("count",))
def open_block(workspace, layout, block, lane, diverged, count):
    """Reset the block's errors and copy its measured warm-up rows into the history."""
    apart = 8 * layout.row_stride
    write(address(workspace.arena, workspace.squares), broadcast(0.0, count))
    for index in range(lane, lane + layout.block_lanes[block]):
        diverged[index] = -1
    measured = address(layout.signals, layout.block_offset[block])
    for step in range(layout.warm_up):
        row = read(measured + step * apart, count)
        write(address(workspace.arena, step * VECTOR * count), row)


@kernel(forceinline=True, _nrt=False, constants=("count",))
def place_operands(program, workspace, layout, sample, count):
    """Compute the address and the stride of every operand for a chunk whose first row is at ``sample``."""
    # Fields are read from their tuples once: each access costs as much as a row.
    arena, places, strides = workspace.arena, workspace.places, workspace.strides
    signals, operands, width = layout.signals, program.operands, VECTOR * count
    flat, apart = layout.signals.shape[1], 8 * layout.row_stride
    for index in range(places.size):
        channel, lag = operands[index, 0], operands[index, 1]
        if channel == TEMPORARY:
            places[index], strides[index] = address(arena, workspace.temporaries + lag * width), 0
        elif channel == 0:
            places[index], strides[index] = address(arena, workspace.predictions - lag * width), 8 * width
        else:
            places[index], strides[index] = address(signals, channel * flat + sample) - lag * apart, apart


@kernel(forceinline=True, _nrt=False, constants=("count",))
def run_chunk(program, theta, workspace, layout, block, chunk, active, squared_error, count):
    """Simulate the steps of a chunk; return the number of lanes whose intervals have not ended.

    The predictions and the running squared errors are in the workspace; ``squared_error`` receives those of
    the intervals that end in this chunk.
    """
    arena, places, strides = workspace.arena, workspace.places, workspace.strides
    targets, squares = workspace.targets, workspace.squares
    code, addresses, factors, degree = program.code, program.addresses, program.factors, program.degree
    length, lane = layout.length, chunk.lane
    sample = layout.block_offset[block] + (layout.warm_up + chunk.begin) * layout.row_stride
    place_operands(program, workspace, layout, sample, count)
    measured = address(layout.signals, sample)
    prediction = address(arena, workspace.predictions)
    for step in range(chunk.begin, chunk.begin + chunk.steps):
        while length[lane + active - 1] <= step:
            active -= 1
            squared_error[lane + active] = arena[squares + active]
        for index in range(code.shape[0]):
            first, second = get_place(places, code[index, 2]), get_place(places, code[index, 3])
            execute(code[index, 0], targets[index], first, second, addresses[index], count, 1)
        # The terms are added in their order.
        y = broadcast(0.0, count)
        for term in range(theta.size):
            a, b = places[factors[term, 0]], places[factors[term, 1]]
            c, d = places[factors[term, 2]], places[factors[term, 3]]
            product = multiply_factors(a, b, c, d, degree[term], count)
            y = add(y, multiply(broadcast(theta[term], count), product))
        write(prediction, y)
        error = subtract(y, read(measured, count))
        square = add(read(address(arena, squares), count), multiply(error, error))
        write(address(arena, squares), square)
        for index in range(places.size):
            places[index] += strides[index]
        prediction += 8 * VECTOR * count
        measured += 8 * layout.row_stride
    return active


@kernel(forceinline=True, _nrt=False)
def get_place(places, operand):
    """Return the address of an operand of an instruction."""
    # An unsigned index is not checked for being negative: the loop over the instructions is the hottest one.
    return places[np.uint64(operand)]


@kernel(forceinline=True, _nrt=False, constants=("count",))
def move_history(workspace, layout, chunk, count):
    """Copy the last rows of a chunk to the place of the warm-up rows."""
    width = VECTOR * count
    for step in range(layout.warm_up):
        row = load(workspace.arena, (step + chunk.steps) * width, count)
        write(address(workspace.arena, step * width), row)


@kernel(forceinline=True, _nrt=False)
def close_block(workspace, lane, lanes, active, error_before, squared_error):
    """Store the errors of the lanes that ran to the block's end; return ``error_before`` plus the block's."""
    for index in range(active):
        squared_error[lane + index] = workspace.arena[workspace.squares + index]
    for index in range(lanes):
        error_before += squared_error[lane + index]
    return error_before


@kernel(_nrt=False)
def running_error(workspace, active):
    """Return the sum of the squared errors of the lanes whose intervals have not ended."""
    total = 0.0
    for lane in range(active):
        total += workspace.arena[workspace.squares + lane]
    return total


@kernel(_nrt=False)
def find_divergence(workspace, layout, chunk, bound, diverged):
    """Record the step at which each lane exceeded the bound.

    Return whether a lane has exceeded it, in this chunk or an earlier one.
    """
    found = False
    for lane in range(chunk.lanes):
        for step in range(min(chunk.steps, layout.length[chunk.lane + lane] - chunk.begin)):
            value = workspace.arena[workspace.predictions + step * layout.width + lane]
            if diverged[chunk.lane + lane] < 0 and not (abs(value) <= bound):
                diverged[chunk.lane + lane] = chunk.begin + step
        found |= diverged[chunk.lane + lane] >= 0
    return found


@kernel(_nrt=False)
def scatter(workspace, layout, chunk, predicted):
    """Copy the predictions of a chunk to their samples of the record."""
    for lane in range(chunk.lanes):
        first = layout.start[chunk.lane + lane] + chunk.begin
        for step in range(min(chunk.steps, layout.length[chunk.lane + lane] - chunk.begin)):
            predicted[first + step] = workspace.arena[workspace.predictions + step * layout.width + lane]
