"""A truth: a physical system whose every part may be another one than the simulation takes it for."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

from islands.performance.trials.injection.excitation import Excitation, Signal

#: Takes what drives the truth and a signal, and gives the signal as it really is.
Map = Callable[[Excitation, Signal], Signal]

#: Takes coordinate and rate, each in its usual size, and a state of its own; gives a force in the usual size,
#: and how the state changes with the coordinate.
Force = Callable[[float, float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Plant(ABC):
    """A system with whatever was hidden in it; one with parameters and an equation derives from it.

    Attributes
    ----------
    gain : callable or None
        Of time: what the system's own gain is multiplied by.
    before, beside, behind : tuple
        What acts on the input, as a force in the equation, and on the output, in this order.
    """

    gain: Callable[[Signal], Signal] | None = None
    before: tuple[Map, ...] = field(default=())
    beside: tuple[Force, ...] = field(default=())
    behind: tuple[Map, ...] = field(default=())

    @abstractmethod
    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """Return what the system makes of an input behind its map, shape (samples,)."""


def simulate_plant(truth: Plant, drive: Excitation) -> Signal:
    """Return what the truth does, at its own rate, shape (samples,)."""
    x = drive.u
    for change in truth.before:
        x = change(drive, x)
    y = truth.equation(drive, x)
    for change in truth.behind:
        y = change(drive, y)
    return y
