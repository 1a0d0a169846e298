"""One-step-ahead prediction, multiple shooting and free run with the same kernel (the paper, section 2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.data.signal_map import map_signals
from islands.errors import SettingsError
from islands.kernels.simulate import Layout, simulate
from islands.kernels.summation import dot, total
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.program.term_pool import link
from islands.simulation.blocks import make_simulator
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, EvaluationOutcome, Status

#: A prediction has diverged if its absolute value exceeds this multiple of the output's scale.
BOUND = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """Predictions of a record.

    Attributes
    ----------
    y : ndarray, shape (samples,)
        One value for each sample at the rate of the model, in the unit of the record: as measured, or as
        deviations if the record is preprocessed. NaN during the warm-up of every segment, and from a
        divergence to the end of its interval.
    mean_squared_error : float
        Mean over all predicted samples. Infinite after a divergence, NaN if a measured output is missing.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first diverged sample.
    """

    y: NDArray[np.float64]
    mean_squared_error: float
    outcome: EvaluationOutcome


def one_step_ahead(model: DynamicModel, record: Dataset, warm_up: int | None = None) -> Simulation:
    """Predict every sample from measured past samples."""
    return multiple_shooting(model, record, 1, warm_up)


def free_run(
    model: DynamicModel, record: Dataset, warm_up: int | None = None, bound: float | None = None
) -> Simulation:
    """Simulate every segment from its first samples; the output is only read during the warm-up."""
    return multiple_shooting(model, record, None, warm_up, bound)


def multiple_shooting(
    model: DynamicModel,
    record: Dataset,
    interval: int | None,
    warm_up: int | None = None,
    bound: float | None = None,
) -> Simulation:
    """Simulate shooting intervals, each from measured values.

    Parameters
    ----------
    model : Model
    record : Dataset
    interval : int or None
        Length of an interval in samples. None is the whole segment.
    warm_up : int or None
        Number of samples before the first prediction. None is the model's largest lag.
    bound : float or None
        A prediction with a larger absolute value has diverged. None is the `divergence_bound` of the record.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        The record does not match the model (see `match_record`), is too short, or its output is missing in a
        warm-up.
    SettingsError
        The warm-up is shorter than the model's largest lag, or the interval is less than 1.
    """
    record, offset = map_signals(model, record)
    if warm_up is None:
        warm_up = model.maximum_lag
    if warm_up < model.maximum_lag:
        raise SettingsError(f"the model reads {model.maximum_lag} samples back, the warm-up has {warm_up}")
    theta = np.array(model.parameters)
    bound = divergence_bound(record) if bound is None else bound
    if not isinstance(model, Model):
        return _simulate_block(model, record, interval, warm_up, bound, offset)
    cut = layout(record, warm_up, interval)
    squared_error = np.empty(len(cut.start))
    diverged = np.empty(len(cut.start), np.int64)
    predicted = np.full(record.samples, np.nan)
    simulate(link(model.regressors), theta, cut, bound, np.inf, True, squared_error, diverged, predicted)
    failed = _remove_diverged(predicted, cut, diverged)
    if offset:
        predicted += offset
    if failed.size:
        sample = int((cut.start + diverged)[failed].min())
        reason = f"|y| left {bound:.3g} at sample {sample}"
        return Simulation(predicted, np.inf, EvaluationOutcome(Status.DIVERGED, reason))
    return Simulation(predicted, float(total(squared_error) / cut.length.sum()), OK)


def _simulate_block(
    model: DynamicModel,
    record: Dataset,
    interval: int | None,
    warm_up: int,
    bound: float,
    offset: float,
) -> Simulation:
    """Simulate the block of a model; ``offset`` is added to its output."""
    simulate_record = make_simulator(model.block(), record, interval, warm_up)
    predicted = simulate_record(np.array([model.parameters]))[0, 0]
    failed = simulate_record.remove_diverged(predicted[None], [bound])
    if failed:
        sample, _ = failed
        reason = f"|y| left {bound:.3g} at sample {sample}"
        return Simulation(predicted + offset, np.inf, EvaluationOutcome(Status.DIVERGED, reason))
    error = (predicted - record.y)[simulate_record.predicted]
    return Simulation(predicted + offset, float(dot(error, 0, error, 0, error.size)) / error.size, OK)


def free_runs(
    model: DynamicModel, thetas: NDArray[np.float64], record: Dataset, warm_up: int
) -> NDArray[np.float64]:
    """Simulate every segment of a record once for each of several parameter vectors of a structure.

    Parameters
    ----------
    model : Model
        Structure; its parameters are not used.
    thetas : ndarray, shape (vectors, terms)
    record : Dataset
        Record with the inputs of the model.
    warm_up : int
        Number of samples before the first prediction, at least the largest lag of the model.

    Returns
    -------
    ndarray, shape (vectors, samples)
        NaN during the warm-up of every segment, and from a divergence to the end of its segment.

    Raises
    ------
    RecordError
        The record does not match the model, is too short, or its output is missing in a warm-up.
    """
    record, offset = map_signals(model, record)
    if not isinstance(model, Model):
        simulate_record = make_simulator(model.block(), record, None, warm_up)
        bound = divergence_bound(record)
        predicted = simulate_record(thetas)[:, 0]
        for run in predicted:
            simulate_record.remove_diverged(run[None], [bound])
        return predicted + offset
    program, cut, bound = link(model.regressors), layout(record, warm_up), divergence_bound(record)
    squared_error, diverged = np.empty(len(cut.start)), np.empty(len(cut.start), np.int64)
    predicted = np.full((len(thetas), record.samples), np.nan)
    for theta, run in zip(thetas, predicted, strict=True):
        simulate(program, theta, cut, bound, np.inf, True, squared_error, diverged, run)
        _remove_diverged(run, cut, diverged)
    return predicted + offset if offset else predicted


def _remove_diverged(
    predicted: NDArray[np.float64], cut: Layout, diverged: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Set the predictions after a divergence to NaN; return the lanes that diverged."""
    failed = np.flatnonzero(diverged >= 0)
    for lane in failed:
        predicted[cut.start[lane] + diverged[lane] : cut.start[lane] + cut.length[lane]] = np.nan
    return failed


def divergence_bound(record: Dataset) -> float:
    """Return the absolute output above which a simulation of the record has diverged.

    The bound is `BOUND` times the larger of the output's range and its largest absolute value. If outputs are
    missing or all are zero, it is at least `BOUND` in the output's unit.
    """
    known = record.y[~np.isnan(record.y)]
    return divergence_bound_of_range(known, complete=known.size == record.samples)


def divergence_bound_of_range(known: NDArray[np.float64], complete: bool) -> float:
    """Return the `divergence_bound` for the known outputs; ``complete`` means that no output is missing."""
    scale = float(max(np.ptp(known), np.abs(known).max())) if known.size else 0.0
    if not complete or scale == 0.0:
        scale = max(scale, 1.0)
    return BOUND * scale
