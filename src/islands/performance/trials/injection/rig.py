"""A system that something can be hidden in: its truth, its drive and its recorder, and what can be hidden."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from islands.performance.trials.injection.excitation import Excitation
from islands.performance.trials.injection.faults import Fault
from islands.performance.trials.injection.plant import Plant

#: Stated tolerances are so many times the spread of the truth.
_STATED = 2.0


@dataclass(frozen=True, slots=True)
class Rig:
    """A system.

    Attributes
    ----------
    plant : Plant
        With its nominal parameters.
    relative_error : mapping
        How far a truth's parameters are from their nominal values, as relative standard deviations.
    excitation : callable
        Draws what drives it, over some seconds.
    seconds : float
        The usual length of a record.
    decimation : int
        How many samples of the truth make one of the record.
    noise : float
        Standard deviation relative to the usual largest output.
    input, output : tuple of str
        Name and unit of the columns.
    neighbour : tuple of str
        Name and unit of the channel that may couple in.
    known : mapping
        What can be hidden, by its name in the catalogue.
    unknown : mapping
        Causes that the catalogue has no name for, by what they are.
    """

    plant: Plant
    relative_error: Mapping[str, float]
    excitation: Callable[[np.random.Generator, float], Excitation]
    seconds: float
    decimation: int
    noise: float
    input: tuple[str, str]
    output: tuple[str, str]
    neighbour: tuple[str, str]
    known: Mapping[str, Fault]
    unknown: Mapping[str, Fault]

    @property
    def tolerance(self) -> Mapping[str, float]:
        """Tolerances of its parameters that whoever made the simulation would state."""
        return {name: _STATED * spread for name, spread in self.relative_error.items()}


def fault_table(*hidden: Fault) -> Mapping[str, Fault]:
    """Return what can be hidden by its name."""
    return {each.name: each for each in hidden}
