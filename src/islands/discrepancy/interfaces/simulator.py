"""A core: the simulation that is held against a record, before anything is added to it."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, ForceLaw, Site

#: Elements that act on a core's coordinate, and the values of each.
Forces = Sequence[tuple[ForceLaw, Signal]]


class Simulator(Protocol):
    """What every simulation declares: its parameters, and where effects can enter it."""

    @property
    def name(self) -> str:
        """How it is asked for."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its own parameters."""

    @property
    def sites(self) -> frozenset[Site]:
        """Where effects can enter."""

    @property
    def understood(self) -> frozenset[str]:
        """Names of the effects on its state equation that it knows itself."""

    @property
    def has(self) -> frozenset[str]:
        """Names of the effects that are in its equation already: nobody looks for them."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects of its own: those of each of its states."""

    @property
    def integrates(self) -> bool:
        """Whether it solves an equation in steps, so that what its input does between samples matters."""

    def frame(self, scene: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate that forces act on; ``output`` is that of the nominal simulation."""

    def simulate(
        self, values: Signal, x: Signal, scene: SimulationContext, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """Simulate.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        x : ndarray, shape (samples,)
            The input behind its map.
        scene : SimulationContext
        own : mapping
            Parameters of effects that it understands, by name; what is not named is zero.
        forces : sequence
            Elements on its coordinate.

        Returns
        -------
        ndarray, shape (samples,)
            The output before its map.
        """
