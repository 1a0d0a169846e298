"""Plant: the physical system of a trial, in which faults can be injected."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

from lab.diagnosis.injection.excitation import Excitation, Signal

#: Takes the excitation and a signal; returns the changed signal.
Map = Callable[[Excitation, Signal], Signal]

#: Takes coordinate and rate, both normalised by their typical size, and the state of the force; returns the
#: normalised force and the derivative of the state by the coordinate.
Force = Callable[[float, float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Plant(ABC):
    """Base class of plants with injected faults. Subclasses add parameters and the equation.

    Attributes
    ----------
    gain_profile : callable or None
        Function of time by which the gain of the plant is multiplied.
    input_maps, forces, output_maps : tuple
        Faults that act on the input, as forces in the equation, and on the output, in this order.
    """

    gain_profile: Callable[[Signal], Signal] | None = None
    input_maps: tuple[Map, ...] = field(default=())
    forces: tuple[Force, ...] = field(default=())
    output_maps: tuple[Map, ...] = field(default=())

    @abstractmethod
    def equation(self, drive: Excitation, x: Signal) -> Signal:
        """Return the output for an input x after the input maps, shape (samples,)."""


def simulate_plant(plant: Plant, drive: Excitation) -> Signal:
    """Return the output of a plant at the sampling rate of the excitation, shape (samples,)."""
    x = drive.u
    for change in plant.input_maps:
        x = change(drive, x)
    y = plant.equation(drive, x)
    for change in plant.output_maps:
        y = change(drive, y)
    return y
