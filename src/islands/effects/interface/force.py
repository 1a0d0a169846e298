"""Force laws: forces on a coordinate that depend on its position, its rate and an internal state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from islands.effects.interface.context import Signal, SimulationContext
from islands.kernels.mechanics import WIDTH, Elements, compile_law, integrate_along

#: ``(coordinate, rate, internal state, numbers) -> number``: a scalar function that Numba can compile.
Law = Callable[[float, float, float, Any], float]


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """A force on a coordinate, positive if it resists the motion.

    Attributes
    ----------
    force : callable
        ``(x, rate, z, numbers) -> force``. The numbers are the values of the effect, then the constants.
    state_derivative : callable or None
        ``(x, rate, z, numbers) -> z'``: derivative of the internal state. None if the law has no state.
    constants : callable
        ``context -> numbers``: constants, which are not calibrated.
    is_dissipative : bool
        Whether the force dissipates energy, as friction and drag do.
    initial_state_index : int or None
        Index of the value that is the initial internal state; None if the initial state is zero.
    equation, state_equation : str
        The same force and derivative as expressions of ``x``, its rate ``v``, the state ``z`` and the numbers
        ``n0``, ``n1``, ..., for simulations of equations, which compute expressions faster than functions.
        Empty if the force is only a function.
    """

    force: Law
    state_derivative: Law | None = None
    constants: Callable[[SimulationContext], tuple[float, ...]] = lambda _: ()
    is_dissipative: bool = False
    initial_state_index: int | None = None
    equation: str = ""
    state_equation: str = ""

    def get_initial_state(self, values: Signal) -> float:
        """Return the internal state at the first sample."""
        return 0.0 if self.initial_state_index is None else float(values[self.initial_state_index])


def pack_force_laws(
    forces: Sequence[tuple[ForceLaw, Signal]], context: SimulationContext, balance: bool
) -> Elements:
    """Pack force laws and their values into arrays for the kernels.

    Parameters
    ----------
    forces : sequence
        Force laws and the values of each.
    context : SimulationContext
    balance : bool
        Whether the forces enter an equation of motion, in which all of them resist. Otherwise they are added
        to the output, and dissipative forces have the sign of the force coordinate.
    """
    numbers = np.zeros((len(forces), WIDTH))
    for row, (element, values) in zip(numbers, forces, strict=True):
        given = (*values, *element.constants(context))
        row[: len(given)] = given
    return Elements(
        np.array([compile_law(element.force).address for element, _ in forces], dtype=np.int64),
        np.array(
            [
                compile_law(element.state_derivative).address if element.state_derivative else 0
                for element, _ in forces
            ],
            dtype=np.int64,
        ),
        np.array(
            [
                -1.0 if balance else context.force_coordinate.sign if element.is_dissipative else 1.0
                for element, _ in forces
            ]
        ),
        np.array([element.get_initial_state(values) for element, values in forces]),
        numbers,
    )


def add_output_forces(
    x: Signal, context: SimulationContext, forces: Sequence[tuple[ForceLaw, Signal]]
) -> Signal:
    """Return the sum of the forces on the coordinate ``x``, for a simulator without inertia."""
    total: Signal = sum_output_forces([x], context, [forces])[0]
    return total


def sum_output_forces(
    inputs: Sequence[Signal], context: SimulationContext, forces: Sequence[Sequence[tuple[ForceLaw, Signal]]]
) -> Signal:
    """Return `add_output_forces` of several simulations, shape (simulations, samples).

    A law is computed once for equal inputs and values.

    Parameters
    ----------
    inputs : sequence of ndarray, each of shape (samples,)
        Coordinate of each simulation. Equal ones are the same array.
    forces : sequence of sequence
        Forces of each simulation.
    """
    distinct: dict[int, dict[tuple[ForceLaw, bytes], tuple[ForceLaw, Signal]]] = {id(x): {} for x in inputs}
    for x, given in zip(inputs, forces, strict=True):
        distinct[id(x)] |= {(law, values.tobytes()): (law, values) for law, values in given}
    signals: dict[tuple[int, ForceLaw, bytes], Signal] = {}
    for x in {id(x): x for x in inputs}.values():
        laws = distinct[id(x)]
        signals |= zip(
            ((id(x), *key) for key in laws), _integrate_forces(x, context, list(laws.values())), strict=True
        )
    sums = np.zeros((len(inputs), inputs[0].size))
    for row, (x, given) in enumerate(zip(inputs, forces, strict=True)):
        for law, values in given:
            sums[row] += signals[id(x), law, values.tobytes()]
    return sums


def _integrate_forces(
    x: Signal, context: SimulationContext, forces: Sequence[tuple[ForceLaw, Signal]]
) -> Signal:
    """Return each force on the coordinate ``x``, shape (forces, samples)."""
    found = np.zeros((len(forces), x.size))
    if forces:
        x, elements = np.ascontiguousarray(x), pack_force_laws(forces, context, balance=False)
        integrate_along(x, np.gradient(x, context.dt), context.dt, elements, found)
    return found
