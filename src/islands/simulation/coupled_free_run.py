"""Free run of a coupled model: every equation reads the simulated past of all outputs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.compatibility import ColumnReference, match_record
from islands.data.coupled_record import CoupledRecord
from islands.data.signal_map import map_signals, match_rate
from islands.errors import RecordError, SettingsError
from islands.kernels.summation import dot
from islands.models.coupled_narx import CoupledModel
from islands.simulation.blocks import BlockSimulator
from islands.simulation.layout import check_warm_up, find_intervals
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.predictors import divergence_bound


@dataclass(frozen=True, slots=True, eq=False)
class CoupledSimulation:
    """Predictions of all outputs of a record.

    Attributes
    ----------
    y : ndarray, shape (samples, outputs)
        NaN during the warm-up of every segment, and for all outputs from the divergence of one to the end of
        the interval.
    mean_squared_errors : tuple of float
        Mean over the predicted samples, by output. Infinite after a divergence, NaN if a measured output is
        missing.
    outcome : EvaluationOutcome
        OK, or DIVERGED with the first diverged sample.
    """

    y: NDArray[np.float64]
    mean_squared_errors: tuple[float, ...]
    outcome: EvaluationOutcome


class CoupledSimulator:
    """A structure on a record, for simulations with different parameters.

    Parameters
    ----------
    model : CoupledModel
        Its parameters are passed to the calls.
    record : CoupledRecord
        Record with the columns and the sampling time of the model.
    interval : int or None
        Length of a shooting interval in samples. None is the free run over each whole segment.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.

    Raises
    ------
    RecordError
        The record does not match the model, is too short, or an output is missing in a warm-up.
    SettingsError
        The warm-up is shorter than the largest lag, or the interval is less than 1.
    """

    def __init__(
        self,
        model: CoupledModel,
        record: CoupledRecord,
        interval: int | None = None,
        warm_up: int | None = None,
    ) -> None:
        record, self._offsets = _map_signals(model, match_coupled(model, record))
        self._warm_up = model.maximum_lag if warm_up is None else warm_up
        if self._warm_up < model.maximum_lag:
            raise SettingsError(
                f"the model reads {model.maximum_lag} samples back, the warm-up has {self._warm_up}"
            )
        if interval is not None and interval < 1:
            raise SettingsError(f"a shooting interval has at least 1 sample, got {interval}")
        self._y = record.y
        start, length = find_intervals(record.records[0], self._warm_up, interval)
        for each in record.records:
            check_warm_up(each.y, start, self._warm_up)
        self._bounds = [divergence_bound(each) for each in record.records]
        self._simulate = BlockSimulator(
            model.block(), self._y.T, record.records[0].u.T, start, length, self._warm_up
        )

    def __call__(self, theta: NDArray[np.float64]) -> CoupledSimulation:
        """Simulate with the parameters of all equations, one after the other."""
        runs = self._simulate(theta[None])[0]
        failed = self._simulate.remove_diverged(runs, self._bounds)
        predicted = np.ascontiguousarray(runs.T)
        if failed:
            sample, output = failed
            reason = f"|y{output + 1}| left {self._bounds[output]:.3g} at sample {sample}"
            outcome = EvaluationOutcome(Status.DIVERGED, reason)
            return CoupledSimulation(predicted + self._offsets, (np.inf,) * self._y.shape[1], outcome)
        return CoupledSimulation(predicted + self._offsets, self._mean_squares(predicted), OK)

    def _mean_squares(self, predicted: NDArray[np.float64]) -> tuple[float, ...]:
        known = ~np.isnan(predicted[:, 0])
        errors = np.ascontiguousarray((predicted - self._y)[known].T)
        return tuple(float(dot(error, 0, error, 0, error.size)) / error.size for error in errors)


def coupled_free_run(
    model: CoupledModel, record: CoupledRecord, warm_up: int | None = None
) -> CoupledSimulation:
    """Simulate every segment from its first samples; the outputs are only read during the warm-up.

    A record as measured is filtered, decimated and averaged as that of the model (see `match_rate`), and the
    offsets of the model are subtracted from it and added to the simulation.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        The record does not match the model, is too short, or an output is missing in a warm-up.
    SettingsError
        The warm-up is shorter than the model's largest lag.
    """
    theta = np.array(model.parameters)
    return CoupledSimulator(model, record.map(lambda each: match_rate(model, each)), None, warm_up)(theta)


def _map_signals(model: CoupledModel, record: CoupledRecord) -> tuple[CoupledRecord, NDArray[np.float64]]:
    """Return the signals that the equations read, and the offset that is added to every output."""
    mapped = [
        map_signals(
            ColumnReference(
                *(model.input_names, each.output_name, model.dt, model.average),
                model.output_preprocessing(place),
            ),
            each,
        )
        for place, each in enumerate(record.records)
    ]
    return CoupledRecord(tuple(each for each, _ in mapped)), np.array([offset for _, offset in mapped])


def match_coupled(model: CoupledModel, record: CoupledRecord) -> CoupledRecord:
    """Return a record with its columns in the order of a model.

    Outputs are matched by name, or by position if no name occurs in both; inputs as in `match_record`.

    Raises
    ------
    RecordError
        The columns, units or sampling time of the record are not those of the model.
    """
    by_name = {each.output_name: each for each in record.records}
    records = record.records
    if set(by_name) == set(model.output_names):
        records = tuple(by_name[name] for name in model.output_names)
    elif len(records) != len(model.models) or set(by_name) & set(model.output_names):
        raise RecordError(
            f"the model has the outputs {', '.join(model.output_names)}, the record "
            f"{', '.join(record.output_names)}: name the same outputs"
        )
    return CoupledRecord(
        tuple(
            match_record(ColumnReference(model.input_names, name, model.dt), each)
            for name, each in zip(model.output_names, records, strict=True)
        )
    )
