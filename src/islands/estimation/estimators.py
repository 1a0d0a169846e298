"""Functions of the estimators: how the parameters of a structure are estimated."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from islands.errors import lookup
from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.estimator_table import ESTIMATORS
from islands.estimation.extended_least_squares import extended_least_squares
from islands.estimation.parameter_constraints import constraint
from islands.estimation.refinement import refine
from islands.expressions.tree import Lagged
from islands.models.narx import Model, require_narx
from islands.models.protocol import DynamicModel
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status

#: Estimates parameters from (start, record, constraints, warm-up, samples of an interval or None).
EstimatorFunction = Callable[
    [FittedStructure, Dataset, str, int | None, int | None], FittedStructure | EvaluationOutcome
]


def estimate_with(
    estimator: str,
    start: FittedStructure,
    record: Dataset,
    constraints: str = "none",
    warm_up: int | None = None,
    shooting: int = 500,
) -> FittedStructure | EvaluationOutcome:
    """Estimate the parameters of a structure with an entry of ``ESTIMATORS``.

    Parameters
    ----------
    estimator : str
    start : FittedStructure
        The structure with the parameters of least squares (`estimate`) under the same constraints.
    record : Dataset
    constraints : str
        Statements of ``constraint``.
    warm_up : int or None
        Number of samples before the first row. None is the largest lag.
    shooting : int
        Samples of a shooting interval of the estimator ``shooting``.

    Returns
    -------
    FittedStructure or EvaluationOutcome
        With the largest difference from the parameters of least squares, in standard errors; see
        `least_squares_bias`. An outcome after a failure: DIVERGED, INFEASIBLE, SINGULAR or TOO_FEW_ROWS.

    Raises
    ------
    SettingsError
        The estimator is unknown; else as `estimate` and `refine`.
    """
    entry = lookup(ESTIMATORS, estimator, "estimator")
    found = _FUNCTIONS[estimator](start, record, constraints, warm_up, entry.interval(shooting))
    if isinstance(found, EvaluationOutcome) or found is start:
        return found
    return replace(found, least_squares_bias=_difference(start.model, found.model))


def least_squares_bias(
    model: DynamicModel, record: Dataset, constraints: str = "none", warm_up: int | None = None
) -> float | EvaluationOutcome:
    """Measure how far coloured noise shifts the least-squares parameters of a structure.

    Least squares is consistent only if the equation error is white. The measure is the largest difference of
    a parameter from extended least squares, divided by its standard error there. Under white noise it
    is below 1 to 2, because least squares has the smaller variance and the variance of the difference is the
    difference of the variances (Hausman 1978). A larger number says that least squares is biased: the noise
    is coloured or the structure lacks a term.

    Parameters
    ----------
    model : DynamicModel
        Only its structure is used.
    record : Dataset
    constraints, warm_up
        As in `estimate`.

    Returns
    -------
    float or EvaluationOutcome
        An outcome if an estimate fails.
    """
    narx = require_narx(model)
    start = estimate(narx.regressors, record, constraints, warm_up)
    if isinstance(start, EvaluationOutcome):
        return start
    found = estimate_with("extended-least-squares", start, record, constraints, warm_up)
    if isinstance(found, EvaluationOutcome):
        return found
    assert found.least_squares_bias is not None
    return found.least_squares_bias


def _difference(start: Model, found: Model) -> float:
    """Return the largest difference of a parameter in standard errors of the second model."""
    assert found.standard_errors is not None
    steps = np.abs(np.subtract(found.parameters, start.parameters))
    errors = np.array(found.standard_errors)
    known = errors > 0.0
    return float(np.max(steps[known] / errors[known], initial=0.0))


def _keep(
    start: FittedStructure, _record: Dataset, _constraints: str, _warm_up: int | None, _interval: int | None
) -> FittedStructure:
    return start


def _extend(
    start: FittedStructure, record: Dataset, constraints: str, warm_up: int | None, _interval: int | None
) -> FittedStructure | EvaluationOutcome:
    model = start.model
    constrained = constraint(constraints).constrain(model.regressors)
    if isinstance(constrained, EvaluationOutcome):
        return constrained
    if constrained.regressors != model.regressors:
        return EvaluationOutcome(
            Status.INFEASIBLE, "the constraint forces a parameter to zero: remove its term"
        )
    first = model.maximum_lag if warm_up is None else warm_up
    *psi, y = regressor_matrix([*model.regressors, Lagged(0, 0)], record, first)
    rows = np.array([length - first for length in record.segments if length > first])
    found = extended_least_squares(np.array(psi), y, constrained.S, constrained.c, rows)
    if isinstance(found, EvaluationOutcome):
        return found
    theta = constrained.enforce(found.estimate.theta)
    if not constrained.has_signs(theta):
        return EvaluationOutcome(
            Status.INFEASIBLE, "a parameter has the wrong sign under coloured noise: remove its term"
        )
    return FittedStructure(
        model.with_parameters(theta.tolist(), found.estimate.standard_errors.tolist()),
        found.estimate.residual_variance,
        found.noise,
    )


def _simulate(
    start: FittedStructure, record: Dataset, constraints: str, warm_up: int | None, interval: int | None
) -> FittedStructure | EvaluationOutcome:
    # Least squares may be far away from the minimum of the free run.
    found = refine(start.model, record, interval, constraints, warm_up, max_steps=100)
    if isinstance(found, EvaluationOutcome):
        return found
    return FittedStructure(found.model, found.after)


_FUNCTIONS: Mapping[str, EstimatorFunction] = MappingProxyType(
    {
        "least-squares": _keep,
        "extended-least-squares": _extend,
        "shooting": _simulate,
        "free-run": _simulate,
    }
)
