"""Rig: a plant with its excitation, its measurement and its faults."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lab.diagnosis.injection.excitation import Excitation
from lab.diagnosis.injection.faults import Fault
from lab.diagnosis.injection.plant import Plant

#: Stated tolerances in standard deviations of the plant's parameters.
_TOLERANCE_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Rig:
    """A system under trial.

    Attributes
    ----------
    plant : Plant
        Plant with its nominal parameters.
    relative_error : mapping
        Relative standard deviations of the parameters around their nominal values.
    excitation : callable
        Draws an excitation of a given length in seconds.
    seconds : float
        Default length of a record.
    decimation : int
        Number of plant samples per recorded sample.
    controller_lag : float
        Time constant in seconds of the low-pass filter of the controller of records in closed loop.
    noise : float
        Standard deviation of the measurement noise relative to the typical largest output.
    input, output : tuple of str
        Names and units of the columns.
    neighbour : tuple of str
        Name and unit of the neighbouring channel.
    known : mapping
        Faults that the catalogue of effects has a name for, by this name.
    unknown : mapping
        Faults that the catalogue has no name for.
    """

    plant: Plant
    relative_error: Mapping[str, float]
    excitation: Callable[[np.random.Generator, float], Excitation]
    seconds: float
    decimation: int
    controller_lag: float
    noise: float
    input: tuple[str, str]
    output: tuple[str, str]
    neighbour: tuple[str, str]
    known: Mapping[str, Fault]
    unknown: Mapping[str, Fault]

    @property
    def tolerance(self) -> Mapping[str, float]:
        """Tolerances of the parameters as the author of the simulator would state them."""
        return {name: _TOLERANCE_SIGMAS * spread for name, spread in self.relative_error.items()}


def fault_table(*faults: Fault) -> Mapping[str, Fault]:
    """Return the faults by their names."""
    return {fault.name: fault for fault in faults}
