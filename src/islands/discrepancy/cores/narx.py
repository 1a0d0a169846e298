"""An identified model in free run, with places for effects."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.core import Forces, add_forces
from islands.discrepancy.effect import Scene, Signal, Site
from islands.discrepancy.parameter import Parameter
from islands.errors import ModelError
from islands.model.model import Model
from islands.simulation.predictors import free_run

#: A change of a parameter that matters, relative to it.
_SCALE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class NarxCore:
    """A model's free run from the first measured samples on; its parameters are calibrated.

    Parameters that a constraint ties to each other stay as they are, so that the constraint holds: of the
    linear terms of the output none moves. An effect on the output acts behind the model: within it, a model
    whose output's coefficients sum to one would integrate it.

    Attributes
    ----------
    model : Model
    name : str
    start : ndarray, shape (maximum lag,)
        Measured outputs that the free run begins with.
    """

    model: Model
    name: str
    start: Signal
    sites: frozenset[Site] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    understood: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the terms that are not linear in the output alone."""
        theta = self.model.parameters
        return tuple(
            Parameter(f"theta{place + 1}", "", theta[place], _SCALE * abs(theta[place]) or _SCALE)
            for place in self._moving
        )

    @property
    def _moving(self) -> tuple[int, ...]:
        return tuple(
            place
            for place, item in enumerate(self.model.regressors)
            if not (item.lags and {channel for channel, _ in item.lags} == {0} and item.degree == 1)
        )

    def simulate(
        self,
        values: Signal,
        x: Signal,
        scene: Scene,
        _own: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """See `islands.discrepancy.core.Core`."""
        theta = list(self.model.parameters)
        for place, value in zip(self._moving, values, strict=True):
            theta[place] = float(value)
        warm_up = self.model.maximum_lag
        y = np.full(x.size, np.nan)
        y[:warm_up] = self.start[:warm_up]
        run = free_run(replace(self.model, theta=tuple(theta)), Dataset(u=x, y=y, dt=scene.dt))
        simulated = run.y.copy()
        simulated[:warm_up] = self.start[:warm_up]
        return add_forces(simulated, x, scene, forces)
