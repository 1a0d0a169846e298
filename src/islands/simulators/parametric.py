"""Identified model of a class with named parameters, in free run."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Site
from islands.effects.interface.force import sum_output_forces
from islands.errors import ModelError
from islands.models.block import Block, subtract_offsets
from islands.models.parametric import ParametricModel
from islands.simulation.blocks import BlockSimulator
from islands.simulators.interface import BatchSimulator, SimulationRun

#: Typical change of a parameter, relative to its value.
_SCALE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class ParametricSimulator(BatchSimulator):
    """Free run of a model, started from the first measured samples; all of its parameters are calibrated.

    Attributes
    ----------
    model : ParametricModel
    name : str
    start : ndarray, shape (maximum lag,) or longer
        Measured output; the free run starts from its first samples.

    Raises
    ------
    ModelError
        The model has several inputs.
    """

    model: ParametricModel
    name: str = field()  # without it, the property of the base class would be the default
    start: Signal
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    _block: Block = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )
        object.__setattr__(self, "_block", subtract_offsets(self.model.block(), self.model.preprocessing))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the model, and mean of the initial outputs, whose measured samples have noise."""
        start = self.start[: self._block.maximum_lag]
        named = zip(self.model.names, self.model.parameters, strict=True)
        return (
            *(Parameter(name, "", value, _SCALE * abs(value) or _SCALE) for name, value in named),
            Parameter(
                "initial output",
                "",
                float(start.mean()),
                _SCALE * float(np.max(np.abs(start))) or _SCALE,
                initial=True,
            ),
        )

    def for_samples(self, first: int, last: int) -> "ParametricSimulator":
        """Return the free run from the first measured outputs of one recording."""
        return replace(self, start=self.start[first:last])

    def with_values(self, values: Signal) -> ParametricModel:
        """Return the model with the given values of its parameters."""
        return self.model.with_parameters(values[: self.model.size].tolist())

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""
        simulated: NDArray[np.float64] = np.empty((len(runs), runs[0].x.size))
        groups: dict[tuple[int, float], list[int]] = {}
        for place, run in enumerate(runs):
            groups.setdefault((id(run.x), float(run.values[-1])), []).append(place)
        for (_, level), places in groups.items():
            parameters = np.array([runs[place].values[:-1] for place in places])
            simulated[places] = self._simulate(runs[places[0]].x, level, parameters)
        if any(run.forces for run in runs):
            simulated += sum_output_forces([run.x for run in runs], context, [run.forces for run in runs])
        return simulated[:, ::every]

    def _simulate(self, x: Signal, level: float, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Simulate an input with several sets of parameters; ``level`` is the mean of the initial outputs."""
        warm_up = self._block.maximum_lag
        measured = self.start[:warm_up]
        outputs = np.full((1, x.size), np.nan)
        outputs[0, :warm_up] = measured + (level - measured.mean())
        start, length = np.array([warm_up]), np.array([x.size - warm_up])
        simulate = BlockSimulator(self._block, outputs, x[None], start, length, warm_up)
        found = simulate(parameters)[:, 0]
        found[:, :warm_up] = outputs[0, :warm_up]
        return found
