"""Arguments of the kernel that integrates a system in several lanes: arrays that belong together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.simd import VECTOR

#: Vectors of a row. Most instructions wait for the result of the one before, so that two vectors cost little
#: more than one.
VECTORS = 2

#: Lanes: sets of parameters and initial states that are simulated at once.
LANES = VECTORS * VECTOR

#: Lanes of machine code if there are many: four vectors in registers take little more time than two.
MANY_LANES = 2 * LANES


class Instructions(NamedTuple):
    """Instructions over rows of one arena.

    Attributes
    ----------
    code : ndarray of int64, shape (instructions, 5)
        Operation, target row, and the rows of up to three operands.
    ends : ndarray of int64, shape (4,)
        End of each section of the code: what depends on parameters alone, on time and signals, on states, and
        what only the outputs need.
    signals : ndarray of int64, shape (signals,)
        Rows of the signals.
    states : int
        Row of the first state; those of the force laws follow.
    slopes : ndarray of int64, shape (states,)
        Rows of the derivatives.
    outputs : ndarray of int64, shape (outputs,)
        Rows of the outputs.
    rows : int
        Number of rows.
    """

    code: NDArray[np.int64]
    ends: NDArray[np.int64]
    signals: NDArray[np.int64]
    states: int
    slopes: NDArray[np.int64]
    outputs: NDArray[np.int64]
    rows: int


class LaneSignals(NamedTuple):
    """Signals at the start, in the middle and at the end of each step.

    Attributes
    ----------
    shared : ndarray, shape (samples, 3, shared)
        Signals that are equal in all lanes.
    own : ndarray, shape (different * samples, 3, 1)
        Signals of single lanes, one after another.
    places : ndarray of int64, shape (restarts or 1, signals, lanes)
        Index in ``own``, as one row, of the first value of each further signal in each lane. If there are
        several, each restart has its own.
    """

    shared: NDArray[np.float64]
    own: NDArray[np.float64]
    places: NDArray[np.int64]


class LaneForces(NamedTuple):
    """Force laws in every lane; addresses as in `islands.kernels.mechanics.Elements`.

    Attributes
    ----------
    forces, state_derivatives : ndarray of int64, shape (laws,)
    numbers : ndarray, shape (laws, 16, WIDTH)
    """

    forces: NDArray[np.int64]
    state_derivatives: NDArray[np.int64]
    numbers: NDArray[np.float64]


class LaneLimits(NamedTuple):
    """Limits of the states in every lane; size 0 for none.

    Attributes
    ----------
    lower, upper : ndarray, shape (states*16,)
    receivers : ndarray of int64, shape (states,)
        Index of the state that receives the part ``caught`` of what the upper limit of a state cuts off.
    caught : ndarray, shape (states*16,)
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    receivers: NDArray[np.int64]
    caught: NDArray[np.float64]


class LaneRestarts(NamedTuple):
    """Samples at which the first states are set to given values; the others are kept. Size 0 for none.

    The first sample is one of them, and the distances between them are equal.

    Attributes
    ----------
    samples : ndarray of int64, shape (restarts,)
    states : ndarray, shape (restarts, restarted*16)
    """

    samples: NDArray[np.int64]
    states: NDArray[np.float64]
