"""An element: a force between a coordinate and the ground, by its rate and what it remembers."""

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
    """What acts on a coordinate, written as what resists its motion.

    Attributes
    ----------
    force : callable
        ``(x, rate, z, numbers) -> force``; the numbers are the effect's values, then the constants.
    memory : callable or None
        ``(x, rate, z, numbers) -> z'``, of the element's own state.
    constants : callable
        ``scene -> numbers`` that are no values.
    dissipative : bool
        It resists the motion itself: friction, drag.
    begins : int or None
        Which of the effect's values is the element's state at the first sample; None: it begins at zero.
    """

    force: Law
    memory: Law | None = None
    constants: Callable[[SimulationContext], tuple[float, ...]] = lambda _: ()
    dissipative: bool = False
    begins: int | None = None


def pack_force_laws(
    parts: Sequence[tuple[ForceLaw, Signal]], scene: SimulationContext, balance: bool
) -> Elements:
    """Return elements with their values as the kernels take them.

    Parameters
    ----------
    balance : bool
        In a balance of forces all of them resist; beside an output stiffness adds to it, and friction as the
        coordinate's frame has it.
    """
    numbers = np.zeros((len(parts), WIDTH))
    for row, (element, values) in zip(numbers, parts, strict=True):
        given = (*values, *element.constants(scene))
        row[: len(given)] = given
    return Elements(
        np.array([compiled(element.force).address for element, _ in parts], dtype=np.int64),
        np.array(
            [compiled(element.memory).address if element.memory else 0 for element, _ in parts],
            dtype=np.int64,
        ),
        np.array(
            [-1.0 if balance else scene.frame.sense if element.dissipative else 1.0 for element, _ in parts]
        ),
        np.array([0.0 if element.begins is None else values[element.begins] for element, values in parts]),
        numbers,
    )


def add_output_forces(
    x: Signal, scene: SimulationContext, parts: Sequence[tuple[ForceLaw, Signal]]
) -> Signal:
    """Return what elements add to an output whose coordinate is ``x``: without inertia it answers at once."""
    total = np.zeros(x.size)
    if not parts:
        return total
    x = np.ascontiguousarray(x)
    integrate_along(
        x, np.gradient(x, scene.dt), scene.dt, pack_force_laws(parts, scene, balance=False), total
    )
    return total
