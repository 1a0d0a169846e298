"""Parameter estimation of a structure: constraint, regressor matrix, constrained least squares."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.estimation.constrained_least_squares import constrained_least_squares
from islands.estimation.constraints.checks import check_constraints
from islands.estimation.constraints.conditions import Constrained
from islands.estimation.estimator_table import Criterion
from islands.estimation.parameter_constraints import constraint
from islands.expressions.tree import Lagged
from islands.models.narx import Model, canonical_order
from islands.models.regressor import Regressor
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status


@dataclass(frozen=True, slots=True)
class FittedStructure:
    """A model with estimated parameters.

    Attributes
    ----------
    model : Model
    residual_variance : float
        Variance of the equation error (the one-step-ahead residual), or of the residual that another
        estimator minimises.
    noise : tuple of float
        Coefficients of the noise terms e(k-1), e(k-2), ... of extended least squares.
    least_squares_bias : float or None
        Largest difference of a parameter from least squares in standard errors; see `least_squares_bias` in
        `islands.estimation.estimators`. None for least squares itself.
    criterion : Criterion or None
        Error that the parameters minimise, if it is not that of the estimator of the settings.
    """

    model: Model
    residual_variance: float
    noise: tuple[float, ...] = ()
    least_squares_bias: float | None = None
    criterion: Criterion | None = None


def estimate(
    regressors: Sequence[Regressor],
    record: Dataset,
    constraints: str = "none",
    warm_up: int | None = None,
    standard_errors: bool = True,
) -> FittedStructure | EvaluationOutcome:
    """Estimate the parameters of a structure on a record.

    Parameters
    ----------
    regressors : sequence of Regressor
    record : Dataset
    constraints : str
        Statements of ``constraint``. Regressors whose parameter is forced to zero are removed. While a
        parameter has the wrong sign, the term with the smallest t-ratio of them is removed.
    warm_up : int or None
        Number of samples before the first row. None is the largest lag.
    standard_errors : bool
        Whether the model has standard errors, which take as long as the parameters.

    Returns
    -------
    FittedStructure or EvaluationOutcome
        An outcome INFEASIBLE, SINGULAR or TOO_FEW_ROWS after a failure.

    Raises
    ------
    ModelError
        There is no regressor, or a regressor reads an input that the record does not have.
    RecordError
        An output is missing, or no segment is longer than the warm-up.
    SettingsError
        The constraint is unknown, or the warm-up is shorter than the largest lag.
    """
    kept: Sequence[Regressor] = canonical_order(regressors)
    while True:
        constrained = constraint(constraints).constrain(kept)
        if isinstance(constrained, EvaluationOutcome):
            return constrained
        # The ratios below need standard errors.
        fitted = _estimate_constrained(
            constrained, record, warm_up, standard_errors or bool(constrained.signs.any())
        )
        if isinstance(fitted, EvaluationOutcome):
            return fitted
        theta = np.array(fitted.model.theta)
        if constrained.has_signs(theta):
            break
        errors = np.array(fitted.model.standard_errors)
        # The minimum under one sign lies where the parameter is zero, because the squared error is convex.
        ratio = constrained.signs * theta / np.maximum(errors, np.finfo(float).tiny)
        worst = constrained.regressors[int(np.argmin(ratio))]
        kept = [item for item in constrained.regressors if item != worst]
    unmet = [check for check in check_constraints(fitted.model, constraints) if not check.met]
    if unmet:
        return EvaluationOutcome(
            Status.INFEASIBLE, f"{unmet[0].text} is not met: the model has the value {unmet[0].value:g}"
        )
    return fitted


def _estimate_constrained(
    constrained: Constrained, record: Dataset, warm_up: int | None, standard_errors: bool
) -> FittedStructure | EvaluationOutcome:
    structure = Model(constrained.regressors, None, record.input_names, record.output_name, record.dt)
    structure = replace(structure, preprocessing=record.preprocessing)
    first = structure.maximum_lag if warm_up is None else warm_up
    matrix = regressor_matrix([*structure.regressors, Lagged(0, 0)], record, first)
    found = constrained_least_squares(matrix[:-1], matrix[-1], constrained.S, constrained.c, standard_errors)
    if not found.outcome:
        return found.outcome
    return FittedStructure(
        structure.with_parameters(
            constrained.enforce(found.theta).tolist(),
            found.standard_errors.tolist() if standard_errors else None,
        ),
        found.residual_variance,
    )
