"""Multiple-shooting residual of a model as a function of its parameters."""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from islands.estimation.damped_least_squares import Residual, approximate_jacobian
from islands.kernels.simulate import DIVERGED, simulate
from islands.models.coupled_narx import AnyModel
from islands.models.narx import Model
from islands.program.term_pool import link
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset
from islands.simulation.blocks import make_simulator
from islands.simulation.initial_outputs import STEP, change_initial_outputs, count_segments
from islands.simulation.layout import layout
from islands.simulation.predictors import divergence_bound, find_divergence_bound
from islands.simulation.sensitivities import make_sensitivities

#: Largest number of initial outputs that are estimated with the parameters.
_LARGEST_CHANGES = 64


class ShootingResidual(Residual):
    """The multiple-shooting residual of a model as a function of its parameters.

    Parameters
    ----------
    model : Model
        Model whose free parameters are passed to the calls.
    record : Dataset
        Record without missing outputs.
    interval : int or None
        Length of a shooting interval in samples: 1 is one-step-ahead, None is the free run.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.
    """

    def __init__(self, model: Model, record: Dataset, interval: int | None, warm_up: int | None) -> None:
        self._first = model.maximum_lag if warm_up is None else warm_up
        self._interval, self._program = interval, link(model.regressors)
        self._lay_out(record)
        self._predicted = np.zeros(record.samples, bool)
        for start, length in zip(self._cut.start, self._cut.length, strict=True):
            self._predicted[start : start + length] = True
        self._sensitivities = make_sensitivities(model.regressors, record, self._first, interval)
        #: Number of samples of every interval, in the order of time.
        self.intervals = self._cut.length[np.argsort(self._cut.start)]

    def _lay_out(self, record: Dataset) -> None:
        self._record, self._cut = record, layout(record, self._first, self._interval)
        self._y, self._bound = record.y, find_divergence_bound(record)

    def with_record(self, record: Dataset) -> "ShootingResidual":
        """Return the residual on the same record with other initial outputs."""
        found = copy(self)
        found._lay_out(record)
        return found

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return prediction minus measurement over all predicted samples, or None after a divergence."""
        lanes = len(self._cut.start)
        predicted = np.empty(len(self._y))
        error, diverged = np.empty(lanes), np.empty(lanes, np.int64)
        ending = simulate(
            self._program, theta, self._cut, self._bound, np.inf, False, error, diverged, predicted
        )
        if ending == DIVERGED:
            return None
        # The memory of other samples is not initialised: differences of it may overflow.
        return predicted[self._predicted] - self._y[self._predicted]

    def differentiate(
        self, theta: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives along directions, shape (free, samples).

        They are exact, but for central differences if a primitive of the user has no known derivative.
        """
        if self._sensitivities is not None:
            return self._sensitivities.with_record(self._record)(theta, directions)
        return approximate_jacobian(
            lambda moved: [self(each) for each in moved], theta, int(self._predicted.sum()), directions
        )


class FreeRunResidual(Residual):
    """The error of the free run of a model as a function of its parameters and of the initial outputs.

    The values are the parameters, followed by the changes of the outputs before the first prediction of every
    segment. The initial outputs are measured, too: the changes are the last errors.

    Parameters
    ----------
    model : Model
        Model whose free parameters are passed to the calls.
    record : Dataset
        Record without missing outputs.
    warm_up : int or None
        Number of samples before the first prediction. None is the largest lag.
    """

    def __init__(self, model: Model, record: Dataset, warm_up: int | None) -> None:
        self._model, self._record = model, record
        self._first = model.maximum_lag if warm_up is None else warm_up
        self._depth, self._segments = model.output_lag, count_segments(record, self._first)
        self._step = STEP * record.output_range
        self._started = np.zeros(self.changes), ShootingResidual(model, record, None, warm_up)
        #: Number of samples of every segment, in the order of time; then every initial output.
        self.intervals = np.append(self._started[1].intervals, np.ones(self.changes, np.int64))

    @property
    def changes(self) -> int:
        """Number of initial outputs."""
        return self._segments * self._depth

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return prediction minus measurement and the changes, or None after a divergence."""
        parameters, changes = np.split(theta, [self._model.size])
        error = self._start(changes)(parameters)
        return None if error is None else np.append(error, changes)

    def differentiate(
        self, theta: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives along directions, shape (free, samples + changes)."""
        terms = self._model.size
        parameters, changes = np.split(theta, [terms])
        slopes = self._start(changes).differentiate(parameters, np.eye(terms))
        samples, ends = slopes.shape[1], np.cumsum(self.intervals[: self._segments])
        derivatives = np.zeros((len(theta), samples + self.changes))
        derivatives[:terms, :samples] = slopes
        derivatives[terms:, samples:] = np.eye(self.changes)
        for place in range(self._depth):
            # A change in one segment has no effect on the others.
            moved = np.zeros((self._segments, self._depth))
            moved[:, place] = self._step
            errors = [self._start(changes + sign * moved.ravel())(parameters) for sign in (1.0, -1.0)]
            if errors[0] is None or errors[1] is None:
                continue
            slope = (errors[0] - errors[1]) / (2.0 * self._step)
            for segment, (begin, end) in enumerate(zip((0, *ends[:-1]), ends, strict=True)):
                derivatives[terms + segment * self._depth + place, begin:end] = slope[begin:end]
        along: NDArray[np.float64] = np.einsum("tf,tk->fk", directions, derivatives)
        return along

    def _start(self, changes: NDArray[np.float64]) -> ShootingResidual:
        """Return the residual from changed initial outputs."""
        if not np.array_equal(changes, self._started[0]):
            record = change_initial_outputs(
                self._record, changes.reshape(self._segments, self._depth), self._first
            )
            self._started = changes, self._started[1].with_record(record)
        return self._started[1]


class BlockResidual(Residual):
    """The simulation error of the block of a model as a function of its parameters.

    The errors of several outputs are relative to the ranges of the outputs. They follow one another sample by
    sample, so that a block of rows is a block of time.

    Parameters
    ----------
    model, record, interval, warm_up
        As for `ShootingResidual`; see `make_simulator` for the intervals.
    """

    def __init__(
        self,
        model: AnyModel,
        record: AnyRecord,
        interval: int | None,
        warm_up: int | None,
    ) -> None:
        first = model.maximum_lag if warm_up is None else warm_up
        self._simulate = make_simulator(model, record, interval, first)
        self._predicted = self._simulate.predicted
        outputs = np.atleast_2d(record.y.T)
        self._y = outputs[:, self._predicted]
        self._bounds = np.array([[divergence_bound(y)] for y in outputs])
        self._scales = np.ones((1, 1))
        #: Number of rows of every interval, in the order of time.
        self.intervals = self._simulate.intervals
        if isinstance(record, CoupledRecord):
            self._scales = np.array([[each.output_range or 1.0] for each in record.records])
            # The scores of all outputs at one sample are summed at least.
            lengths = np.ones(self._y.shape[1], np.int64) if interval is None else self.intervals
            self.intervals = len(outputs) * lengths

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return prediction minus measurement over all predicted samples, or None after a divergence."""
        return self._evaluate(theta[None])[0]

    def differentiate(
        self, theta: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives along directions by central differences, shape (free, samples)."""
        return approximate_jacobian(self._evaluate, theta, self._y.size, directions)

    def _evaluate(self, thetas: NDArray[np.float64]) -> list[NDArray[np.float64] | None]:
        """Return the residual of each of several parameter vectors, which are simulated together."""
        runs = self._simulate.simulate_outputs(thetas)[:, :, self._predicted]
        return [
            ((run - self._y) / self._scales).T.reshape(-1) if (np.abs(run) <= self._bounds).all() else None
            for run in runs
        ]


def make_free_run_residual(model: AnyModel, record: AnyRecord, warm_up: int | None) -> FreeRunResidual | None:
    """Return the error of the free run with its initial outputs as parameters.

    None if the model is not a NARX model of one output, or if there are none or more than 64 initial outputs.
    """
    if not (isinstance(model, Model) and isinstance(record, Dataset)):
        return None
    residual = FreeRunResidual(model, record, warm_up)
    return residual if 0 < residual.changes <= _LARGEST_CHANGES else None


def make_residual(
    model: AnyModel,
    record: AnyRecord,
    interval: int | None,
    warm_up: int | None,
) -> ShootingResidual | BlockResidual:
    """Return the multiple-shooting residual of a model of any class; see `ShootingResidual`."""
    if isinstance(model, Model):
        assert isinstance(record, Dataset), "the record matches the model"
        return ShootingResidual(model, record, interval, warm_up)
    return BlockResidual(model, record, interval, warm_up)
