"""A column of the record: somebody else's simulation, of which only the output is known."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.core import Forces, add_forces
from islands.discrepancy.effect import Scene, Signal, Site
from islands.discrepancy.parameter import Parameter


@dataclass(frozen=True, slots=True, eq=False)
class ColumnCore:
    """An output as it was simulated elsewhere.

    What acts on its input or in its equation cannot be simulated anew: effects on the output, and forces of
    the input as it was recorded, are all that can be looked for.

    Attributes
    ----------
    name : str
    simulated : ndarray, shape (samples,)
    """

    name: str
    simulated: Signal
    parameters: tuple[Parameter, ...] = ()
    sites: frozenset[Site] = frozenset((Site.FORCE, Site.OUTPUT))
    understood: frozenset[str] = frozenset()

    def simulate(
        self,
        _values: Signal,
        x: Signal,
        scene: Scene,
        _own: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """See `islands.discrepancy.core.Core`."""
        return add_forces(np.asarray(self.simulated), x, scene, forces)
