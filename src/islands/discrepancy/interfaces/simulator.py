"""Interface of the simulators that are compared with a record."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Site

#: Force laws on the coordinate of a simulator, and the values of each.
Forces = Sequence[tuple[ForceLaw, Signal]]


class Simulator(Protocol):
    """A simulator: its parameters, and the sites at which effects can enter."""

    @property
    def name(self) -> str:
        """Name on the command line."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator."""

    @property
    def sites(self) -> frozenset[Site]:
        """Sites at which effects can enter."""

    @property
    def supported_effects(self) -> frozenset[str]:
        """Names of catalogue effects that its state equation supports."""

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Names of effects already modelled by the simulator; excluded from the search."""

    @property
    def state_effects(self) -> tuple[Effect, ...]:
        """Effects on its states, in addition to the catalogue."""

    @property
    def is_continuous_time(self) -> bool:
        """Whether it integrates an equation, so that the input between samples matters."""

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate that forces act on; ``output`` is the nominal output, shape (samples,)."""

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """Simulate the output.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        x : ndarray, shape (samples,)
            The input after the input maps.
        scene : SimulationContext
        own : mapping
            Parameters of supported effects by name; a missing one is zero.
        forces : sequence
            Force laws on the coordinate.

        Returns
        -------
        ndarray, shape (samples,)
            The output before the output maps.
        """
