"""Responses of a model to inputs of choice, from a constant output, and to a step of one input."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError
from islands.models.narx import Model, require_narx
from islands.models.operating_point import find_equilibrium
from islands.models.protocol import DynamicModel
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import BOUND, free_run

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
    y : ndarray, shape (samples,)
        Output; NaN after a divergence.
    start : float
        Output before the first sample.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first diverged sample.
    """

    time: NDArray[np.float64]
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    start: float
    outcome: EvaluationOutcome


def input_response(
    model: DynamicModel, u: ArrayLike, y: float | None = None, scale: float = 0.0
) -> InputResponse:
    """Simulate the response of a model to inputs at its rate.

    Before the first sample the inputs have their first values, and the output is constant. The response is
    the free run of a record with these values.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    u : array_like, shape (samples,) or (samples, inputs)
        Inputs as measured, at the sampling time of the model.
    y : float, optional
        Output before the first sample; by default the stable equilibrium at the first values of the inputs.
    scale : float
        Size of the output, if it is known. The response has diverged above `BOUND` times the largest of this
        size, of the inputs, of ``y`` and of 1.

    Raises
    ------
    ModelError
        The model has no unique stable equilibrium at the first inputs, and no output is given.
    SettingsError
        The inputs are not those of the model, there is no sample, or a number is not finite.
    """
    signals = _read_inputs(model, u)
    start = find_equilibrium(require_narx(model), signals[0].tolist()) if y is None else float(y)
    if not np.isfinite(start):
        raise SettingsError(f"the output before the first sample is a finite number, got {start}")
    # The first samples only fill the past of the model.
    before = model.maximum_lag
    record = make_resting_record(model, np.vstack([np.tile(signals[0], (before, 1)), signals]), start)
    bound = BOUND * max(1.0, scale, abs(start), float(np.abs(signals).max()))
    run = free_run(model, record, bound=bound)
    time = record.dt * np.arange(len(signals), dtype=np.float64)
    return InputResponse(time, signals, run.y[before:], start, run.outcome)


def make_resting_record(model: DynamicModel, u: NDArray[np.float64], rest: float) -> Dataset:
    """Return a record at the rate of a model whose output is known in its first samples and constant.

    Parameters
    ----------
    model : DynamicModel
    u : ndarray, shape (samples, inputs)
        Inputs as measured: those that the model reads one sample early are advanced by its simulation.
    rest : float
        Output in as many samples as the largest lag of the model.
    """
    y = np.full(len(u), np.nan)
    y[: model.maximum_lag] = rest
    dt = 1.0 if model.dt is None else model.dt
    done = model.preprocessing and model.preprocessing.without_offsets
    return Dataset(u, y, dt, model.column_names, model.output_name, preprocessing=done)


def _read_inputs(model: DynamicModel, u: ArrayLike) -> NDArray[np.float64]:
    signals = np.asarray(u, dtype=np.float64)
    signals = signals[:, None] if signals.ndim == 1 else signals
    if signals.ndim != 2 or signals.shape[1] != model.inputs:
        raise SettingsError(
            f"the model has the inputs {', '.join(model.column_names)}: give an array of shape (samples, "
            f"{model.inputs}), got {np.shape(u)}"
        )
    if not len(signals):
        raise SettingsError("a response has at least 1 sample, got 0")
    if not np.isfinite(signals).all():
        raise SettingsError("an input is NaN or infinite: give finite numbers")
    return signals


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
    narx = require_narx(model)
    levels = [np.atleast_1d(np.asarray(each, dtype=np.float64)) for each in (start, end)]
    for level in levels:
        if level.shape != (narx.inputs,):
            raise SettingsError(
                f"the model has the inputs {', '.join(narx.column_names)}: give one value for each before "
                f"and after the step, got {level.tolist()}"
            )
    changed = np.flatnonzero(levels[0] != levels[1])
    if not changed.size:
        raise SettingsError("no input changes: give different values before and after the step")
    if samples is not None and samples < 1:
        raise SettingsError(f"a response has at least 1 sample, got {samples}")
    rest = find_equilibrium(narx, levels[0].tolist()) if y is None else y
    count = _FEWEST if samples is None else samples
    while True:
        found = _simulate(narx, levels[0], levels[1], rest, count, int(changed[0]))
        after = found.y[-count:]
        change = np.abs(after - after[-1])
        settled = np.isnan(change).any() or change[count // 2 :].max() <= _SETTLED * change.max()
        if samples is not None or settled or count >= _MOST:
            return found
        count *= 2


def _simulate(
    model: Model,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    rest: float,
    count: int,
    channel: int,
) -> StepResponse:
    before = model.maximum_lag + _BEFORE
    u = np.vstack([np.tile(start, (before, 1)), np.tile(end, (count, 1))])
    record = make_resting_record(model, u, rest)
    scale = max(1.0, abs(rest), float(np.abs(u).max()))
    simulated = free_run(model, record, bound=BOUND * scale).y
    simulated[: model.maximum_lag] = rest
    time = record.dt * np.arange(-before, count, dtype=np.float64)
    return StepResponse(time, u[:, channel], simulated, model.column_names[channel], model.output_name)
