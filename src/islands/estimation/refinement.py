"""Refinement: parameters polished on the simulation error, within the null space of the constraints.

Least squares minimises the error one step ahead; what counts is the error over an interval. Levenberg (1944)
and Marquardt (1963): damped Gauss-Newton steps on the multiple-shooting residual. The constraints keep
holding, since only directions that leave them as they are are searched.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError
from islands.estimation.constrained_least_squares import null_space
from islands.estimation.parameter_constraints import constraint
from islands.kernels.simulate import DIVERGED, Layout, simulate
from islands.kernels.summation import dot
from islands.model.model import Model
from islands.program.term_pool import link
from islands.simulation.layout import layout
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.predictors import divergence_bound, multiple_shooting

#: Step of a central difference, in units of a parameter's size: between truncation and rounding.
_DIFFERENCE = 1e-5

#: The damping at the start, what multiplies it after a failed and a successful step, and where it gives up.
_DAMPING, _UP, _DOWN, _GIVE_UP = 1e-3, 10.0, 0.2, 1e9

#: A relative gain of the squared error under this ends the search.
_GAIN = 1e-8


@dataclass(frozen=True, slots=True)
class RefinedModel:
    """A model with polished parameters, the mean squared error before and after, and the steps taken."""

    model: Model
    before: float
    after: float
    steps: int


def refine(
    model: Model,
    record: Dataset,
    interval: int | None,
    constraints: str = "none",
    warm_up: int | None = None,
    max_steps: int = 30,
) -> RefinedModel | EvaluationOutcome:
    """Polish a model's parameters on the error of multiple shooting.

    Parameters
    ----------
    model : Model
        With parameters that meet the constraints.
    interval : int or None
        Samples of a shooting interval; None is the free run.
    constraints : str
        An entry of ``CONSTRAINTS``; it keeps holding.
    warm_up : int or None
        Samples before the first prediction; None takes the deepest lag.
    max_steps : int
        Accepted steps at the most.

    Returns
    -------
    RefinedModel or EvaluationOutcome
        With standard errors from the Jacobian at the end. INFEASIBLE where the constraint refuses the model
        or one of its regressors, DIVERGED where the model diverges as it is.

    Raises
    ------
    ModelError
        The model has no parameters.
    RecordError
        The record is incomplete, has another number of inputs, or is too short.
    SettingsError
        The warm-up is shorter than the model's deepest lag, or the interval is under 1.
    """
    constrained = constraint(constraints).constrain(model.regressors)
    if isinstance(constrained, EvaluationOutcome):
        return constrained
    if constrained.regressors != model.regressors:
        return EvaluationOutcome(
            Status.INFEASIBLE, "the constraint forces a parameter to zero: leave its term out"
        )
    # It checks what the kernel does not: inputs, lags, the record's length.
    started = multiple_shooting(model, record, interval, warm_up)
    if not started.outcome:
        return started.outcome
    if np.isnan(started.mean_squared_error):
        raise RecordError(f"{record.output_name} is missing somewhere: refinement needs every sample")
    theta = np.array(model.parameters)
    # Each parameter in units of its own size: their sizes differ by many orders.
    unit = np.where(theta == 0.0, 1.0, np.abs(theta))
    found = null_space(constrained.S * unit, constrained.c)
    if isinstance(found, EvaluationOutcome):
        return found
    directions = unit[:, None] * found[1]
    residual = _Residual(model, record, interval, warm_up)
    error = residual(theta)
    assert error is not None, "it did not diverge a moment ago"
    before = residual.mean_square(error)
    damping, steps = _DAMPING, 0
    normal, gradient = residual.normal_equations(theta, error, directions)
    while steps < max_steps and damping < _GIVE_UP:
        damped = normal + damping * np.diag(np.maximum(np.diag(normal), np.finfo(float).tiny))
        candidate = theta - directions @ np.linalg.lstsq(damped, gradient, rcond=None)[0]
        trial = residual(candidate)
        if trial is None or not residual.mean_square(trial) < residual.mean_square(error):
            damping *= _UP
            continue
        gain = 1.0 - residual.mean_square(trial) / residual.mean_square(error)
        theta, error, damping, steps = candidate, trial, damping * _DOWN, steps + 1
        normal, gradient = residual.normal_equations(theta, error, directions)
        if gain < _GAIN:
            break
    after = residual.mean_square(error)
    variance = after * error.size / max(1, error.size - directions.shape[1])
    covariance = directions @ np.linalg.pinv(normal) @ directions.T
    errors = np.sqrt(variance) * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return RefinedModel(model.with_parameters(theta.tolist(), errors.tolist()), before, after, steps)


class _Residual:
    """The multiple-shooting residual as a function of the parameters, summed in the written order."""

    def __init__(self, model: Model, record: Dataset, interval: int | None, warm_up: int | None) -> None:
        first = model.maximum_lag if warm_up is None else warm_up
        self._program = link(model.regressors)
        self._cut: Layout = layout(record, first, interval)
        self._y, self._bound = record.y, divergence_bound(record)
        self._predicted = np.zeros(record.samples, bool)
        for start, length in zip(self._cut.start, self._cut.length, strict=True):
            self._predicted[start : start + length] = True

    def __call__(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return prediction minus measurement over all predicted samples; None after a divergence."""
        lanes = len(self._cut.start)
        predicted = np.empty(len(self._y))
        error, diverged = np.empty(lanes), np.empty(lanes, np.int64)
        ending = simulate(
            self._program, theta, self._cut, self._bound, np.inf, False, error, diverged, predicted
        )
        if ending == DIVERGED:
            return None
        return np.ascontiguousarray((predicted - self._y)[self._predicted])

    def mean_square(self, error: NDArray[np.float64]) -> float:
        """Return the mean of the squares."""
        return float(dot(error, 0, error, 0, error.size)) / error.size

    def normal_equations(
        self, theta: NDArray[np.float64], error: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return J'J and J'r for steps along the directions; one that diverges stands still (zeros)."""
        free = directions.shape[1]
        jacobian: NDArray[np.float64] = np.zeros((free, error.size))
        for j in range(free):
            forward, backward = (self(theta + sign * _DIFFERENCE * directions[:, j]) for sign in (1.0, -1.0))
            if forward is not None and backward is not None:
                jacobian[j] = (forward - backward) / (2.0 * _DIFFERENCE)
        normal: NDArray[np.float64] = np.empty((free, free))
        gradient: NDArray[np.float64] = np.empty(free)
        flat, rows = jacobian.reshape(-1), error.size
        for i in range(free):
            gradient[i] = dot(flat, i * rows, error, 0, rows)
            for j in range(i + 1):
                normal[i, j] = normal[j, i] = dot(flat, i * rows, flat, j * rows, rows)
        return normal, gradient
