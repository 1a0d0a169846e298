"""One-step-ahead prediction, multiple shooting and free run with the same kernel (the paper, section 2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError, check_integers
from islands.kernels.simulate import COMPLETE, Layout, simulate
from islands.kernels.summation import dot, total
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.models.regressor import Regressor
from islands.program.term_pool import link
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset
from islands.records.signal_map import map_coupled_signals, map_signals
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
    y : ndarray, shape (samples,) or (samples, outputs)
        One value for each sample at the rate of the model, in the unit of the record: as measured, or as
        deviations if the record is preprocessed. NaN during the warm-up of every segment, and, for all
        outputs, from the divergence of one to the end of its interval.
    mean_squared_errors : tuple of float
        Mean over all predicted samples, by output. Infinite after a divergence, NaN if a measured output is
        missing.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first diverged sample.
    """

    y: NDArray[np.float64]
    mean_squared_errors: tuple[float, ...]
    outcome: EvaluationOutcome

    @property
    def mean_squared_error(self) -> float:
        """Mean squared error of the only output."""
        (error,) = self.mean_squared_errors
        return error


def one_step_ahead(model: DynamicModel, record: Dataset, warm_up: int | None = None) -> Simulation:
    """Predict every sample from measured past samples."""
    return multiple_shooting(model, record, 1, warm_up)


def free_run(
    model: AnyModel,
    record: AnyRecord,
    warm_up: int | None = None,
    bound: float | None = None,
) -> Simulation:
    """Simulate every segment from its first samples; the outputs are only read during the warm-up."""
    return multiple_shooting(model, record, None, warm_up, bound)


def multiple_shooting(
    model: AnyModel,
    record: AnyRecord,
    interval: int | None,
    warm_up: int | None = None,
    bound: float | None = None,
) -> Simulation:
    """Simulate shooting intervals, each from measured values.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    record : Dataset or CoupledRecord
        A `CoupledRecord` for a model of several outputs. A record as measured is filtered, decimated and
        averaged as that of the model, and the offsets of the model are subtracted from it and added to the
        simulation.
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
    check_integers(warm_up=warm_up)
    first = model.maximum_lag if warm_up is None else warm_up
    if first < model.maximum_lag:
        raise SettingsError(f"the model reads {model.maximum_lag} samples back, the warm-up has {first}")
    if not isinstance(model, Model):
        return _simulate_block(model, record, interval, first, bound)
    signals, offset = map_signals(model, _require_one_output(record))
    theta = np.array(model.parameters)
    bound = find_divergence_bound(signals) if bound is None else bound
    cut = layout(signals, first, interval)
    squared_error = np.empty(len(cut.start))
    diverged = np.empty(len(cut.start), np.int64)
    predicted = np.full(signals.samples, np.nan)
    simulate(link(model.regressors), theta, cut, bound, np.inf, True, squared_error, diverged, predicted)
    failed = _remove_diverged(predicted, cut, diverged)
    if offset:
        predicted += offset
    if failed.size:
        sample = int((cut.start + diverged)[failed].min())
        return _diverged(predicted, sample, "y", bound, 1)
    return Simulation(predicted, (float(total(squared_error) / cut.length.sum()),), OK)


def _simulate_block(
    model: AnyModel,
    record: AnyRecord,
    interval: int | None,
    warm_up: int,
    bound: float | None,
) -> Simulation:
    """Simulate the block of a model."""
    signals, offsets = map_model_signals(model, record)
    block, outputs = model.block(), np.atleast_2d(signals.y.T)
    bounds = [divergence_bound(y) if bound is None else bound for y in outputs]
    simulate_record = make_simulator(model, signals, interval, warm_up)
    predicted = simulate_record.simulate_outputs(np.array([model.parameters]))[0]
    failed = simulate_record.remove_diverged(predicted, bounds)
    y = np.ascontiguousarray(predicted.T.reshape(signals.y.shape)) + offsets
    if failed:
        sample, output = failed
        return _diverged(y, sample, block.signals[output], bounds[output], len(outputs))
    errors = np.ascontiguousarray((predicted - outputs)[:, simulate_record.predicted])
    return Simulation(y, tuple(float(dot(each, 0, each, 0, each.size)) / each.size for each in errors), OK)


def map_model_signals(model: AnyModel, record: AnyRecord) -> tuple[AnyRecord, NDArray[np.float64] | float]:
    """Return the signals of a model, and the offsets that are added to its outputs."""
    if not isinstance(model, CoupledModel):
        return map_signals(model, _require_one_output(record))
    if not isinstance(record, CoupledRecord):
        raise RecordError(
            f"the model has the outputs {', '.join(model.output_names)}: give a CoupledRecord with all"
        )
    return map_coupled_signals(model, record)


def _require_one_output(record: AnyRecord) -> Dataset:
    if isinstance(record, CoupledRecord):
        raise RecordError(
            f"the model has one output, and the record {', '.join(record.output_names)}: give a Dataset"
        )
    return record


def _diverged(y: NDArray[np.float64], sample: int, output: str, bound: float, outputs: int) -> Simulation:
    outcome = EvaluationOutcome(Status.DIVERGED, f"|{output}| left {bound:.3g} at sample {sample}")
    return Simulation(y, (np.inf,) * outputs, outcome)


def free_run_error(
    regressors: Sequence[Regressor],
    theta: Sequence[float],
    record: Dataset,
    warm_up: int,
    allowed: float = np.inf,
) -> float:
    """Return the mean squared error of a free run that stops as soon as its error exceeds an allowed one.

    Parameters
    ----------
    regressors, theta
        Terms of the model, and their parameters.
    record : Dataset
        Record in the units of the model, without missing outputs.
    warm_up : int
        Number of samples before the first prediction, at least the largest lag of the terms.
    allowed : float
        Largest mean squared error of interest.

    Returns
    -------
    float
        Infinite after a divergence, or if the mean squared error exceeds the allowed one.
    """
    cut = layout(record, warm_up)
    squared_error = np.empty(len(cut.start))
    diverged = np.empty(len(cut.start), np.int64)
    samples, bound = int(cut.length.sum()), find_divergence_bound(record)
    limits = cut, bound, allowed * samples, False
    ending = simulate(link(regressors), np.array(theta), *limits, squared_error, diverged, np.empty(0))
    return float(total(squared_error) / samples) if ending == COMPLETE else np.inf


def free_runs(
    model: AnyModel,
    thetas: NDArray[np.float64],
    record: AnyRecord,
    warm_up: int,
) -> NDArray[np.float64]:
    """Simulate every segment of a record once for each of several parameter vectors of a structure.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Structure; its parameters are not used.
    thetas : ndarray, shape (vectors, terms)
    record : Dataset or CoupledRecord
        Record with the inputs of the model.
    warm_up : int
        Number of samples before the first prediction, at least the largest lag of the model.

    Returns
    -------
    ndarray, shape (vectors, samples) or (vectors, samples, outputs)
        NaN during the warm-up of every segment, and from a divergence to the end of its segment.

    Raises
    ------
    RecordError
        The record does not match the model, is too short, or its output is missing in a warm-up.
    """
    signals, offset = map_model_signals(model, record)
    if not isinstance(model, Model):
        outputs = np.atleast_2d(signals.y.T)
        bounds = [divergence_bound(y) for y in outputs]
        simulate_record = make_simulator(model, signals, None, warm_up)
        runs = simulate_record.simulate_outputs(thetas)
        for run in runs:
            simulate_record.remove_diverged(run, bounds)
        return runs.transpose(0, 2, 1).reshape(len(runs), *signals.y.shape) + offset
    assert isinstance(signals, Dataset)
    program, cut, bound = link(model.regressors), layout(signals, warm_up), find_divergence_bound(signals)
    squared_error, diverged = np.empty(len(cut.start)), np.empty(len(cut.start), np.int64)
    predicted = np.full((len(thetas), signals.samples), np.nan)
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


# The bounds of recent records are kept, as their layouts.
@lru_cache(maxsize=8)
def find_divergence_bound(record: Dataset) -> float:
    """Return the `divergence_bound` of the output of a record."""
    return divergence_bound(record.y)


def divergence_bound(y: NDArray[np.float64]) -> float:
    """Return the absolute output above which a simulation of a measured output has diverged.

    The bound is `BOUND` times the larger of the output's range and its largest absolute value. If outputs are
    missing or all are zero, it is at least `BOUND` in the output's unit.
    """
    known = y[~np.isnan(y)]
    return divergence_bound_of_range(known, complete=known.size == y.size)


def divergence_bound_of_range(known: NDArray[np.float64], complete: bool) -> float:
    """Return the `divergence_bound` for the known outputs; ``complete`` means that no output is missing."""
    scale = float(max(np.ptp(known), np.abs(known).max())) if known.size else 0.0
    if not complete or scale == 0.0:
        scale = max(scale, 1.0)
    return BOUND * scale
