"""Recorded output of an external simulation: a column of the record."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.effects.interface.force import add_output_forces
from islands.simulators.coordinates import input_coordinate
from islands.simulators.interface import Forces


@dataclass(frozen=True, slots=True, eq=False)
class RecordedOutput:
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
    parameters: tuple[Parameter, ...] = ()
    sites: frozenset[Site] = frozenset((Site.FORCE, Site.OUTPUT))
    supported_effects: frozenset[str] = frozenset()
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = ()
    is_continuous_time: bool = False

    @property
    def name(self) -> str:
        """Name in reports."""
        return f"column {self.column}"

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the input as the coordinate."""
        return input_coordinate(context, output)

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
