"""Force laws: forces on a coordinate that depend on its position, its rate and an internal state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from islands.discrepancy.interfaces.context import Signal, SimulationContext
from islands.systems.mechanics import WIDTH, Elements, compiled, integrate_along

#: ``(coordinate, rate, own state, numbers) -> number``, a scalar function that can be compiled.
Law = Callable[[float, float, float, Any], float]


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """A force on a coordinate, positive if it resists the motion.

    Attributes
    ----------
    force : callable
        ``(x, rate, z, numbers) -> force``; the numbers are the values of the effect, then the constants.
    state_derivative : callable or None
        ``(x, rate, z, numbers) -> z'``: derivative of the internal state.
    constants : callable
        ``context -> numbers`` that are not calibrated.
    is_dissipative : bool
        Whether it dissipates energy, like friction and drag.
    initial_state_index : int or None
        Index of the value that is the initial internal state; None if that is zero.
    """

    force: Law
    state_derivative: Law | None = None
    constants: Callable[[SimulationContext], tuple[float, ...]] = lambda _: ()
    is_dissipative: bool = False
    initial_state_index: int | None = None


def pack_force_laws(
    parts: Sequence[tuple[ForceLaw, Signal]], context: SimulationContext, balance: bool
) -> Elements:
    """Return force laws and their values as arrays for the kernels.

    Parameters
    ----------
    balance : bool
        True if they enter a balance of forces, in which all of them resist; false if they are added to an
        output, where friction has the sign of the force coordinate.
    """
    numbers = np.zeros((len(parts), WIDTH))
    for row, (element, values) in zip(numbers, parts, strict=True):
        given = (*values, *element.constants(context))
        row[: len(given)] = given
    return Elements(
        np.array([compiled(element.force).address for element, _ in parts], dtype=np.int64),
        np.array(
            [
                compiled(element.state_derivative).address if element.state_derivative else 0
                for element, _ in parts
            ],
            dtype=np.int64,
        ),
        np.array(
            [
                -1.0 if balance else context.force_coordinate.sign if element.is_dissipative else 1.0
                for element, _ in parts
            ]
        ),
        np.array(
            [
                0.0 if element.initial_state_index is None else values[element.initial_state_index]
                for element, values in parts
            ]
        ),
        numbers,
    )


def add_output_forces(
    x: Signal, context: SimulationContext, parts: Sequence[tuple[ForceLaw, Signal]]
) -> Signal:
    """Return the sum of force laws on the coordinate ``x``, for a simulator without inertia."""
    total = np.zeros(x.size)
    if not parts:
        return total
    x = np.ascontiguousarray(x)
    integrate_along(
        x, np.gradient(x, context.dt), context.dt, pack_force_laws(parts, context, balance=False), total
    )
    return total
