"""Values of simulations as arrays of the kernel, in which each simulation is a lane."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.mechanics import WIDTH, Elements
from islands.kernels.simd import padded_size
from islands.simulators.ode.kernel_arguments import LaneForces, LaneLimits
from islands.simulators.ode.program import OdeProgram
from islands.simulators.ode.sampled_signal import SampledSignal


@dataclass(frozen=True, slots=True, eq=False)
class LaneInput:
    """Values and signals of one simulation.

    Attributes
    ----------
    parameters, initial_states : mapping
        Values of the parameters and the states at the first sample by name.
    signals : mapping
        Input, channels and time by name. Lanes share a signal if it is the same object.
    elements : Elements or None
        Force laws with their values; None for none. Their signs are not used: forces resist.
    limits : mapping
        Lower and upper limits of states by name; other states have none.
    spills : mapping
        For a state with an upper limit, the state that receives a part of what the limit cuts off, and that
        part. The receivers are the same in all lanes.
    """

    parameters: Mapping[str, float]
    initial_states: Mapping[str, float]
    signals: Mapping[str, SampledSignal]
    elements: Elements | None = None
    limits: Mapping[str, tuple[float, float]] | None = None
    spills: Mapping[str, tuple[str, float]] | None = None


class LaneArguments(NamedTuple):
    """What a call of the kernel gets of its lanes.

    Attributes
    ----------
    arena : ndarray, shape (rows*lanes,)
        Rows of the program with its constants, parameters and states.
    limits : LaneLimits
    laws : LaneForces
        Force laws that are calls.
    """

    arena: NDArray[np.float64]
    limits: LaneLimits
    laws: LaneForces


class LaneValues:
    """Values of simulations, from which calls of the kernel take their lanes.

    Parameters
    ----------
    program : OdeProgram
    lanes : sequence of LaneInput
        All have the same force laws.
    """

    def __init__(self, program: OdeProgram, lanes: Sequence[LaneInput]) -> None:
        self._rows = program.instructions.rows
        self._values = _stack_values(program, lanes)
        self._limits = _stack_limits(program.states, lanes)
        self._laws = _stack_laws(lanes)

    def take(self, lanes: NDArray[np.int64]) -> LaneArguments:
        """Return the arguments of a call with the given lanes, shape (lanes,)."""
        arena: NDArray[np.float64] = padded_size(lanes.size * self._rows)
        arena.reshape(-1, lanes.size)[: len(self._values)] = self._values[:, lanes]
        limits, laws = self._limits, self._laws
        if limits.lower.size:
            lower, upper, caught = (
                each[:, lanes].reshape(-1) if each.size else each
                for each in (limits.lower, limits.upper, limits.caught)
            )
            limits = LaneLimits(lower, upper, limits.receivers, caught)
        return LaneArguments(arena, limits, laws._replace(numbers=np.take(laws.numbers, lanes, axis=1)))


def _stack_values(program: OdeProgram, lanes: Sequence[LaneInput]) -> NDArray[np.float64]:
    """Return the rows of constants, parameters and states, shape (rows, lanes)."""
    count, states = len(program.constants), program.instructions.states
    laws = lanes[0].elements.forces.size if lanes[0].elements is not None else 0
    rows = np.empty((states + len(program.states) + laws, len(lanes)))
    rows[:count] = program.constants[:, None]
    for column, lane in zip(rows.T, lanes, strict=True):
        column[count : count + len(program.parameters)] = [
            lane.parameters[name] for name in program.parameters
        ]
        own = [lane.initial_states[name] for name in program.states]
        if lane.elements is not None:
            own.extend(lane.elements.initial_states)
        column[states:] = own
    return rows


def _stack_limits(states: Sequence[str], lanes: Sequence[LaneInput]) -> LaneLimits:
    """Return the limits of the states, each of shape (states, lanes); size 0 for none."""
    receivers, none = np.zeros(len(states), dtype=np.int64), np.empty(0)
    if not any(lane.limits for lane in lanes):
        return LaneLimits(none, none, receivers, none)
    free = (-np.inf, np.inf)
    bounds = np.array([[(lane.limits or {}).get(name, free) for lane in lanes] for name in states])
    lower, upper = bounds[..., 0], bounds[..., 1]
    if not any(lane.spills for lane in lanes):
        return LaneLimits(lower, upper, receivers, none)
    for lane in lanes:
        for name, (receiver, _) in (lane.spills or {}).items():
            receivers[states.index(name)] = states.index(receiver)
    caught = [[(lane.spills or {}).get(name, ("", 0.0))[1] for lane in lanes] for name in states]
    return LaneLimits(lower, upper, receivers, np.array(caught))


def _stack_laws(lanes: Sequence[LaneInput]) -> LaneForces:
    """Return the force laws that are calls, with numbers of shape (laws, lanes, WIDTH)."""
    first = lanes[0].elements
    if first is None:
        none = np.empty(0, dtype=np.int64)
        return LaneForces(none, none, np.empty((0, len(lanes), WIDTH)))
    numbers = np.stack([lane.elements.numbers for lane in lanes if lane.elements is not None], axis=1)
    return LaneForces(first.forces, first.state_derivatives, numbers)
