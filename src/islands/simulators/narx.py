"""Identified model in free run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.effects.interface.force import sum_output_forces
from islands.errors import ModelError
from islands.models.narx import Model, make_model
from islands.models.regressor import Regressor
from islands.simulation.linked import LinkedModel
from islands.simulators.interface import BatchSimulator, SimulationRun
from islands.simulators.model_form import SLOPE, MissingTerm, missing_terms, model_form

#: Typical change of a parameter, relative to its value.
_SCALE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class NarxSimulator(BatchSimulator):
    """Free run of a model, started from the first measured samples; its parameters are calibrated.

    Parameters of terms with a single factor that reads the output alone, such as y(k-1), are fixed, so that a
    constraint on them, such as a sum of one, remains satisfied. An effect on the output is added after the
    model; inside a model whose coefficients of the output sum to one, it would be integrated.

    Attributes
    ----------
    model : Model
    name : str
    start : ndarray, shape (maximum lag,) or longer
        Measured output; the free run starts from its first samples.
    """

    model: Model
    name: str = field()  # without it, the property of the base class would be the default
    start: Signal
    sites: ClassVar[frozenset[Site]] = frozenset((Site.INPUT, Site.FORCE, Site.OUTPUT))
    state_effects: tuple[Effect, ...] = field(init=False)
    _calibrated: NDArray[np.int64] = field(init=False, repr=False)
    _theta: Signal = field(init=False, repr=False)
    _linked: LinkedModel = field(init=False, repr=False)
    _missing: tuple[MissingTerm, ...] = field(init=False, repr=False)
    _extended: LinkedModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.model.inputs != 1:
            raise ModelError(
                f"{self.name} has {self.model.inputs} inputs: a diagnosis takes models of one input"
            )
        calibrated = [
            place for place, item in enumerate(self.model.regressors) if not _is_linear_in_output(item)
        ]
        object.__setattr__(self, "_calibrated", np.array(calibrated, dtype=np.int64))
        object.__setattr__(self, "_theta", np.array(self.model.parameters))
        object.__setattr__(self, "_linked", LinkedModel(self.model.regressors))
        missing = missing_terms(self.model, calibrated)
        further = tuple(term.regressor for term in missing)
        object.__setattr__(self, "_missing", missing)
        object.__setattr__(self, "_extended", LinkedModel((*self.model.regressors, *further)))
        object.__setattr__(self, "state_effects", (model_form(self, self.model, missing),) if missing else ())

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the terms that are not fixed, and mean of the initial outputs.

        The initial outputs are measured. A model that holds its output at a constant input would keep their
        noise as an offset.
        """
        theta = self.model.parameters
        start = self.start[: self._linked.warm_up]
        return (
            *(
                Parameter(f"theta{place + 1}", "", theta[place], _SCALE * abs(theta[place]) or _SCALE)
                for place in self._calibrated
            ),
            Parameter(
                "initial output",
                "",
                float(start.mean()),
                _SCALE * float(np.max(np.abs(start))) or _SCALE,
                initial=True,
            ),
        )

    def for_samples(self, first: int, last: int) -> "NarxSimulator":
        """Return the free run from the first measured outputs of one recording."""
        return replace(self, start=self.start[first:last])

    def with_values(self, values: Signal) -> Model:
        """Return the model with the given values of its calibrated parameters."""
        theta = list(self.model.parameters)
        for place, value in zip(self._calibrated, values[:-1], strict=True):
            theta[place] = float(value)
        return replace(self.model, theta=tuple(theta))

    def with_shape(self, values: Signal, shape: Mapping[str, float]) -> Model:
        """Return the model with given values, and missing terms with the coefficients in ``shape``."""
        model = self.with_values(values)
        known = zip(model.regressors, model.parameters, strict=True)
        terms = [(item.expression, parameter) for item, parameter in known]
        terms += [(term.with_slope(shape[SLOPE]), shape[term.name]) for term in self._missing]
        return make_model(terms, model.input_names, model.output_name, model.dt)

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""
        theta = np.tile(self._theta, (len(runs), 1))
        theta[:, self._calibrated] = [run.values[:-1] for run in runs]
        warm_up = self._linked.warm_up
        measured = self.start[:warm_up]
        levels = np.array([[run.values[-1]] for run in runs])
        start = measured + (levels - measured.mean())
        if SLOPE in runs[0].effect_parameters:
            simulated = self._run_extended(theta, runs, start)
        else:
            inputs = {id(run.x): run.x[None] for run in runs}
            simulated = self._linked.free_runs(theta, [inputs[id(run.x)] for run in runs], start)
        simulated[:, :warm_up] = start
        if any(run.forces for run in runs):
            simulated += sum_output_forces([run.x for run in runs], context, [run.forces for run in runs])
        return simulated[:, ::every]

    def _run_extended(self, theta: Signal, runs: Sequence[SimulationRun], start: Signal) -> Signal:
        """Run the model with the missing terms; signals are constant before the first sample."""
        missing = [[run.effect_parameters.get(term.name, 0.0) for term in self._missing] for run in runs]
        before = self._extended.warm_up - start.shape[1]
        inputs, channels = [], dict[tuple[int, float], Signal]()
        for run in runs:
            key = id(run.x), run.effect_parameters[SLOPE]
            if key not in channels:
                padded = np.concatenate([np.full(before, run.x[0]), run.x])
                channels[key] = np.stack([padded, np.full_like(padded, key[1])])
            inputs.append(channels[key])
        first = start[:, :1] if start.shape[1] else np.zeros((len(runs), 1))
        initial = np.hstack([np.repeat(first, before, axis=1), start])
        return self._extended.free_runs(np.hstack([theta, missing]), inputs, initial)[:, before:]


def _is_linear_in_output(item: Regressor) -> bool:
    return item.lags != frozenset() and {channel for channel, _ in item.lags} == {0} and item.degree == 1
