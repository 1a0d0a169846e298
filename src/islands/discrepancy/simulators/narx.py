"""An identified model in free run, with places for effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.effects.model_form import SLOPE, MissingTerm, missing_terms, model_form
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import add_output_forces
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate
from islands.errors import ModelError
from islands.model.model import Model, make_model
from islands.model.regressor import Regressor
from islands.simulation.linked import LinkedModel

#: A change of a parameter that matters, relative to it.
_SCALE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class NarxSimulator:
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
    supported_effects: frozenset[str] = frozenset()
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = field(init=False)
    is_continuous_time: bool = False
    _moving: NDArray[np.int64] = field(init=False, repr=False)
    _theta: Signal = field(init=False, repr=False)
    _linked: LinkedModel = field(init=False, repr=False)
    _missing: tuple[MissingTerm, ...] = field(init=False, repr=False)
    _wider: LinkedModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )
        moving = [place for place, item in enumerate(self.model.regressors) if not _linear_in_output(item)]
        object.__setattr__(self, "_moving", np.array(moving, dtype=np.int64))
        object.__setattr__(self, "_theta", np.array(self.model.parameters))
        object.__setattr__(self, "_linked", LinkedModel(self.model.regressors))
        lacking = missing_terms(self.model, moving)
        further = tuple(term.regressor for term in lacking)
        object.__setattr__(self, "_missing", lacking)
        object.__setattr__(self, "_wider", LinkedModel((*self.model.regressors, *further)))
        object.__setattr__(self, "state_effects", (model_form(self, self.model, lacking),) if lacking else ())

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the terms that are not linear in the output alone, and the mean that the run begins with.

        It begins with measured samples, and what their noise adds to it a model that holds still keeps.
        """
        theta = self.model.parameters
        start = self.start[: self._linked.warm_up]
        return (
            *(
                Parameter(f"theta{place + 1}", "", theta[place], _SCALE * abs(theta[place]) or _SCALE)
                for place in self._moving
            ),
            Parameter(
                "initial output",
                "",
                float(start.mean()),
                _SCALE * float(np.max(np.abs(start))) or _SCALE,
                initial=True,
            ),
        )

    def with_values(self, values: Signal) -> Model:
        """Return the model with values of its calibrated parameters."""
        theta = list(self.model.parameters)
        for place, value in zip(self._moving, values[:-1], strict=True):
            theta[place] = float(value)
        return replace(self.model, theta=tuple(theta))

    def with_shape(self, values: Signal, shape: Mapping[str, float]) -> Model:
        """Return the same with terms that the model lacks, their coefficients and slope by name."""
        model = self.with_values(values)
        own = zip(model.regressors, model.parameters, strict=True)
        terms = [(item.expression, parameter) for item, parameter in own]
        terms += [(term.at(shape[SLOPE]), shape[term.name]) for term in self._missing]
        return make_model(terms, model.input_names, model.output_name, model.dt)

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return input_coordinate(context, output)

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        own: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        theta = self._theta.copy()
        theta[self._moving] = values[:-1]
        warm_up = self._linked.warm_up
        start = self.start[:warm_up] + (values[-1] - self.start[:warm_up].mean())
        if SLOPE in own:
            theta = np.append(theta, [own.get(term.name, 0.0) for term in self._missing])
            simulated = self._run_wider(theta, x, start, own[SLOPE])
        else:
            simulated = self._linked.free_run(theta, x[:, None], start)
        simulated[:warm_up] = start
        return simulated + add_output_forces(x, context, forces) if forces else simulated

    def _run_wider(self, theta: Signal, x: Signal, start: Signal, slope: float) -> Signal:
        """Run with the terms that the model lacks: before the first sample all stood still."""
        before = self._wider.warm_up - start.size
        channels = np.empty((x.size + before, 2))
        channels[:before, 0], channels[before:, 0], channels[:, 1] = x[0], x, slope
        begun = np.concatenate([np.full(before, start[0] if start.size else 0.0), start])
        return self._wider.free_run(theta, channels, begun)[before:]


def _linear_in_output(item: Regressor) -> bool:
    return item.lags != frozenset() and {channel for channel, _ in item.lags} == {0} and item.degree == 1
