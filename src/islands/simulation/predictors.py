"""One-step-ahead, multiple shooting and free run: one kernel, three names (the paper, section 2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.kernels.simulate import simulate
from islands.kernels.summation import total
from islands.model.model import Model
from islands.program.term_pool import link
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, EvaluationOutcome, Status

#: A prediction that leaves this many times the output's range has diverged.
BOUND = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """Predictions of a record.

    Attributes
    ----------
    y : ndarray, shape (samples,)
        NaN in the warm-up of every segment, and from where an interval diverged to its end.
    mean_squared_error : float
        Over all predicted samples; infinite after a divergence, NaN where the measured output is missing.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first sample where it did.
    """

    y: NDArray[np.float64]
    mean_squared_error: float
    outcome: EvaluationOutcome


def one_step_ahead(model: Model, record: Dataset, warm_up: int | None = None) -> Simulation:
    """Predict every sample from the measured past."""
    return multiple_shooting(model, record, 1, warm_up)


def free_run(
    model: Model, record: Dataset, warm_up: int | None = None, bound: float | None = None
) -> Simulation:
    """Simulate every segment from its first samples on; the output is read in the warm-up alone."""
    return multiple_shooting(model, record, None, warm_up, bound)


def multiple_shooting(
    model: Model,
    record: Dataset,
    interval: int | None,
    warm_up: int | None = None,
    bound: float | None = None,
) -> Simulation:
    """Simulate intervals of ``interval`` samples, each from measured values (None: the whole segment).

    Parameters
    ----------
    warm_up : int or None
        Samples before the first prediction; None takes the model's deepest lag, all that it needs.
    bound : float or None
        A larger absolute prediction is a divergence; None takes `divergence_bound` the record.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        The record has another number of inputs, or is too short, or its output is missing in a warm-up.
    SettingsError
        The warm-up is shorter than the model's deepest lag.
    """
    if model.inputs != record.inputs:
        raise RecordError(
            f"the model has {model.inputs} inputs {model.input_names}, the record {record.inputs}"
        )
    if warm_up is None:
        warm_up = model.maximum_lag
    if warm_up < model.maximum_lag:
        raise SettingsError(f"the model reads {model.maximum_lag} samples back, the warm-up has {warm_up}")
    theta = np.array(model.parameters)
    bound = divergence_bound(record) if bound is None else bound
    cut = layout(record, warm_up, interval)
    squared_error = np.empty(len(cut.start))
    diverged = np.empty(len(cut.start), np.int64)
    predicted = np.full(record.samples, np.nan)
    simulate(link(model.regressors), theta, cut, bound, np.inf, True, squared_error, diverged, predicted)
    failed = np.flatnonzero(diverged >= 0)
    for lane in failed:
        predicted[cut.start[lane] + diverged[lane] : cut.start[lane] + cut.length[lane]] = np.nan
    if failed.size:
        sample = int((cut.start + diverged)[failed].min())
        reason = f"|y| left {bound:.3g} at sample {sample}"
        return Simulation(predicted, np.inf, EvaluationOutcome(Status.DIVERGED, reason))
    return Simulation(predicted, float(total(squared_error) / cut.length.sum()), OK)


def divergence_bound(record: Dataset) -> float:
    """Return the absolute output beyond which a simulation of the record has diverged.

    It is `BOUND` times the output's range or largest value; where outputs are missing and what is left tells
    no scale, at least `BOUND` of the output's unit.
    """
    known = record.y[~np.isnan(record.y)]
    return divergence_bound_of_range(known, complete=known.size == record.samples)


def divergence_bound_of_range(known: NDArray[np.float64], complete: bool) -> float:
    """Return the same from the measured outputs, all of the record's or those that are not missing."""
    scale = float(max(np.ptp(known), np.abs(known).max())) if known.size else 0.0
    if not complete or scale == 0.0:
        scale = max(scale, 1.0)
    return BOUND * scale
