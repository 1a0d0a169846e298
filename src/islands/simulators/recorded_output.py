"""Recorded output of an external simulation: a column of the record."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Site
from islands.effects.interface.force import add_output_forces
from islands.simulators.interface import Forces, Simulator


@dataclass(frozen=True, slots=True, eq=False)
class RecordedOutput(Simulator):
    """Output of an external simulation.

    The simulation cannot be repeated with a different input or equation. Only effects on the output and
    forces on the recorded input can be searched for.

    Attributes
    ----------
    column : str
        Name of the column.
    simulated : ndarray, shape (samples,)
        Simulated output.
    """

    column: str
    simulated: Signal
    sites: ClassVar[frozenset[Site]] = frozenset((Site.FORCE, Site.OUTPUT))

    @property
    def name(self) -> str:
        """Name in reports."""
        return f"column {self.column}"

    @property
    def is_recorded(self) -> bool:
        """Whether the output was recorded."""
        return True

    def for_samples(self, first: int, last: int) -> "RecordedOutput":
        """Return the output of one recording."""
        return replace(self, simulated=np.asarray(self.simulated)[first:last])

    def simulate(
        self,
        _values: Signal,
        x: Signal,
        context: SimulationContext,
        _effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        return np.asarray(self.simulated) + add_output_forces(x, context, forces)
