"""A column of the record: somebody else's simulation, of which only the output is known."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import add_output_forces
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate


@dataclass(frozen=True, slots=True, eq=False)
class RecordedOutput:
    """An output as it was simulated elsewhere.

    What acts on its input or in its equation cannot be simulated anew: effects on the output, and forces of
    the input as it was recorded, are all that can be looked for.

    Attributes
    ----------
    column : str
    simulated : ndarray, shape (samples,)
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
        """How it is asked for."""
        return f"column {self.column}"

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return input_coordinate(context, output)

    def simulate(
        self,
        _values: Signal,
        x: Signal,
        context: SimulationContext,
        _own: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return np.asarray(self.simulated) + add_output_forces(x, context, forces)
