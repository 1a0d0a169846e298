"""Responses of a model to inputs of choice and to a step, without a measured output."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.linearisation import EVERYWHERE
from islands.models.protocol import DynamicModel, no_model_error
from islands.records.compatibility import ColumnReference, match_record
from islands.records.coupled import AnyRecord
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.predictors import BOUND, Simulation
from islands.simulation.stepper import Stepper, measure_offsets, read_inputs

#: Steps of the model before the step of the input, besides the largest lag.
_BEFORE = 5

#: Fewest and most steps of a response whose length is not given.
_FEWEST, _MOST = 64, 65_536

#: A response has settled if it changes by less than this fraction in the second half.
_SETTLED = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class InputResponse:
    """Response of a model to inputs of choice.

    Attributes
    ----------
    time : ndarray, shape (samples,)
        Time in seconds, from 0.
    u : ndarray, shape (samples, inputs)
    y : ndarray, shape (samples,) or (samples, outputs)
        Output; NaN after a divergence.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first diverged sample.
    """

    time: NDArray[np.float64]
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    outcome: EvaluationOutcome


def input_response(
    model: AnyModel,
    u: ArrayLike,
    y: ArrayLike | None = None,
    scale: float = 0.0,
    states: ArrayLike | None = None,
    within: tuple[float, float] = EVERYWHERE,
) -> InputResponse:
    """Simulate the response of a model to inputs at its rate.

    Before the first sample the inputs have their first values, and the output is constant.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model with parameters.
    u : array_like, shape (samples,) or (samples, inputs)
        Inputs as measured, at the sampling time of the model.
    y : float or sequence of float, optional
        Outputs before the first sample; by default the stable equilibrium at the first values of the inputs.
    scale : float
        Size of the output, if it is known. The response has diverged above `BOUND` times the largest of this
        size, of the inputs, of ``y`` and of 1.
    states : sequence of float, optional
        States of a state space at the first sample, in place of ``y``.
    within : (float, float), optional
        Range of the output, as that of the data of a model: the only equilibrium in it is taken of several.

    Raises
    ------
    ModelError, SettingsError
        As for `Stepper`; or the inputs are not those of the model, there is no sample, or a number is not
        finite.
    """
    block = model.block()
    signals = read_inputs(model, u, block.columns[block.computed :])
    found = Stepper(model, signals[0], y, states, within).run(signals)
    offsets, _ = measure_offsets(model)
    given = 0.0 if y is None else float(np.abs(np.asarray(y)).max())
    bound = BOUND * max(1.0, scale, given, float(np.abs(signals).max()))
    outside, outcome = ~(np.abs(found - offsets) <= bound), OK
    if outside.any():
        first = int(np.argmax(outside.any(axis=1)))
        name = block.signals[int(np.argmax(outside[first]))]
        outcome = EvaluationOutcome(Status.DIVERGED, f"|{name}| left {bound:.3g} at sample {first}")
        found[first:] = np.nan
    time = (1.0 if model.dt is None else model.dt) * np.arange(len(signals), dtype=np.float64)
    return InputResponse(time, signals, found[:, 0] if block.outputs == 1 else found, outcome)


def simulate_inputs(
    model: AnyModel,
    record: AnyRecord,
    y: ArrayLike | None = None,
    states: ArrayLike | None = None,
    within: tuple[float, float] = EVERYWHERE,
) -> Simulation:
    """Simulate every segment of a record from its inputs alone, from rest or from a given start.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
        Inputs at the rate of the model; its outputs are only compared.
    y, states, within
        As for `input_response`: the start of every segment.

    Returns
    -------
    Simulation
        One value for every sample, from the first one on.

    Raises
    ------
    ModelError, RecordError, SettingsError
        As for `input_response`; or the record does not match the model.
    """
    columns, output = model.block().columns, model.block().outputs
    inputs = columns[len(columns) - len(model.input_names) :]
    data = match_record(ColumnReference(inputs, columns[0], model.dt, model.average), record.records[0])
    done = data.preprocessing
    u = data.u + (done.input_offsets if done else 0.0)
    measured = record.y.reshape(len(u), output)
    runs = [input_response(model, u[begin:end], y, 0.0, states, within) for begin, end in data.bounds]
    found = np.concatenate([each.y.reshape(-1, output) for each in runs])
    found -= [each.preprocessing.output_offset if each.preprocessing else 0.0 for each in record.records]
    outcome = next((each.outcome for each in runs if not each.outcome), OK)
    errors = np.mean((found - measured) ** 2, axis=0) if outcome else np.full(output, np.inf)
    is_coupled = isinstance(model, CoupledModel)
    return Simulation(found if is_coupled else found[:, 0], tuple(errors.tolist()), outcome)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StepResponse:
    """Response of a model to a step of one input.

    Attributes
    ----------
    time : ndarray, shape (samples,)
        Time in seconds; the input steps at 0.
    u : ndarray, shape (samples,)
        Input that steps.
    y : ndarray, shape (samples,)
        Output; NaN after a divergence.
    input_name, output_name : str
    """

    time: NDArray[np.float64]
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    input_name: str
    output_name: str

    def __repr__(self) -> str:
        return f"<StepResponse of {len(self.time)} samples: {self.input_name} to {self.output_name}>"


def step_response(
    model: DynamicModel,
    start: ArrayLike,
    end: ArrayLike,
    y: float | None = None,
    samples: int | None = None,
) -> StepResponse:
    """Simulate the response of a model to a step of its inputs, from rest.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    start, end : float or sequence of float
        Constant value of every input before and after the step.
    y : float, optional
        Output before the step; by default the stable equilibrium. A model of hysteresis rests at any output
        and needs it.
    samples : int, optional
        Steps of the model after the step of the input; by default until the output has settled to a
        hundredth of its change.

    Raises
    ------
    ModelError
        The model has no unique stable equilibrium before the step, and no output is given.
    SettingsError
        There is not one value for each input, no input changes, or there is less than one sample.
    """
    if not isinstance(model, DynamicModel):
        raise no_model_error(model)
    levels = [np.atleast_1d(np.asarray(each, dtype=np.float64)) for each in (start, end)]
    for level in levels:
        if level.shape != (model.inputs,):
            raise SettingsError(
                f"the model has the inputs {', '.join(model.column_names)}: give one value for each before "
                f"and after the step, got {level.tolist()}"
            )
    changed = np.flatnonzero(levels[0] != levels[1])
    if not changed.size:
        raise SettingsError("no input changes: give different values before and after the step")
    if samples is not None and samples < 1:
        raise SettingsError(f"a response has at least 1 sample, got {samples}")
    before, count = model.maximum_lag + _BEFORE, _FEWEST if samples is None else samples
    while True:
        u = np.vstack([np.tile(levels[0], (before, 1)), np.tile(levels[1], (count, 1))])
        found = input_response(model, u, y)
        after = found.y[-count:]
        change = np.abs(after - after[-1])
        settled = np.isnan(change).any() or change[count // 2 :].max() <= _SETTLED * change.max()
        if samples is not None or settled or count >= _MOST:
            channel = int(changed[0])
            names = model.column_names[channel], model.output_name
            return StepResponse(found.time - found.time[before], u[:, channel], found.y, *names)
        count *= 2
