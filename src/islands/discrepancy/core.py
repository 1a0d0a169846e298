"""A core: the simulation that is held against a record, before anything is added to it."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.parameter import Parameter

#: Effects that act as forces, and the values of each.
Forces = Sequence[tuple[Effect, Signal]]


class Core(Protocol):
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

    def simulate(
        self, values: Signal, x: Signal, scene: Scene, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """Simulate.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        x : ndarray, shape (samples,)
            The input behind its map.
        scene : Scene
        own : mapping
            Parameters of effects that it understands, by name; what is not named is zero.
        forces : sequence
            Effects on its coordinate and rate.

        Returns
        -------
        ndarray, shape (samples,)
            The output before its map.
        """


def add_forces(y: Signal, x: Signal, scene: Scene, forces: Forces) -> Signal:
    """Add forces to an output whose coordinate is the input: what has no inertia answers at once."""
    if forces:
        rate = np.gradient(x, scene.dt)
        for effect, strengths in forces:
            assert effect.form is not None
            y = y + effect.form(x, rate, strengths, scene)
    return y
