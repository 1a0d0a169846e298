"""Response of a model to a step of one input, from rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError
from islands.models.narx import Model, require_narx
from islands.models.operating_point import find_equilibrium
from islands.models.protocol import DynamicModel
from islands.simulation.input_response import make_resting_record
from islands.simulation.predictors import BOUND, free_run

#: Steps of the model before the step of the input, besides the largest lag.
_BEFORE = 5

#: Fewest and most steps of a response whose length is not given.
_FEWEST, _MOST = 64, 65_536

#: A response has settled if it changes by less than this fraction in the second half.
_SETTLED = 0.01


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
