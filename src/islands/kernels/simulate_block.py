"""Kernel for equations that read each other's outputs, and for equations with other parameters in each lane.

All equations are one program. Every step evaluates all of them before the next step begins, so that each one
reads the simulated past of the others. A row holds the same step of several runs, as in
`islands.kernels.simulate`.
"""

import numpy as np

from islands.kernels.interpreter import TEMPORARY, execute, multiply_factors
from islands.kernels.jit_cache import kernel
from islands.kernels.simd import VECTOR, add, address, broadcast, multiply, padded_size, read, write

#: Vectors per row for few runs and for many.
_NARROW, _WIDE = 1, 3

#: Runs that are simulated together, few and many.
LANES, MANY_LANES = VECTOR * _NARROW, VECTOR * _WIDE


@kernel
def simulate_block(
    program,  # terms of the equations, in the order of the signals; channels are these signals, then inputs
    weights,  # float64 [term, lane], `LANES` or `MANY_LANES` of them
    constants,  # float64 [constant, lane]: values of the first temporaries
    ends,  # int64 [signal]: the term after the last one of the equation
    warm_up,  # rows before the first predicted one, at least the largest lag
    signals,  # float64 [channel, row * lane]: computed signals after the warm-up are overwritten
):
    """Simulate all computed signals of several runs in place; the caller checks the bound."""
    # There is one function per width, so that the compiler knows the number of lanes of a row.
    if weights.shape[1] == MANY_LANES:
        _wide(program, weights, constants, ends, warm_up, signals)
    else:
        _narrow(program, weights, constants, ends, warm_up, signals)


def _make_simulator(count):
    """Make the simulation with rows of ``count`` vectors."""
    lanes = VECTOR * count

    @kernel
    def run(program, weights, constants, ends, warm_up, signals):
        flat = signals.shape[1]
        temporaries = padded_size(max(1, program.temporaries) * lanes)
        for index in range(constants.shape[0]):
            write(address(temporaries, index * lanes), read(address(constants, index * lanes), count))
        code, addresses, factors, degree = program.code, program.addresses, program.factors, program.degree
        operands = program.operands
        places, strides = np.empty(len(operands), np.int64), np.empty(len(operands), np.int64)
        for index in range(places.size):
            channel, lag = operands[index, 0], operands[index, 1]
            if channel == TEMPORARY:
                places[index], strides[index] = address(temporaries, lag * lanes), 0
            else:
                places[index] = address(signals, channel * flat + (warm_up - lag) * lanes)
                strides[index] = 8 * lanes
        for row in range(warm_up, flat // lanes):
            for index in range(code.shape[0]):
                target = address(temporaries, code[index, 1] * lanes)
                first, second = places[code[index, 2]], places[code[index, 3]]
                execute(code[index, 0], target, first, second, addresses[index], count, 1)
            term = 0
            for signal in range(ends.size):
                # The terms of an equation are added in their order, as in the simulation of a single one.
                y = broadcast(0.0, count)
                while term < ends[signal]:
                    a, b = places[factors[term, 0]], places[factors[term, 1]]
                    c, d = places[factors[term, 2]], places[factors[term, 3]]
                    product = multiply_factors(a, b, c, d, degree[term], count)
                    y = add(y, multiply(read(address(weights, term * lanes), count), product))
                    term += 1
                write(address(signals, signal * flat + row * lanes), y)
            for index in range(places.size):
                places[index] += strides[index]

    return run


_narrow = _make_simulator(_NARROW)
_wide = _make_simulator(_WIDE)
