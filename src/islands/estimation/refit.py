"""Estimation of the parameters of a model on another record of the same system, from those that it has."""

from collections.abc import Callable

from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.estimator_table import Criterion
from islands.estimation.estimators import estimate_with
from islands.estimation.latent_refit import refit_latent
from islands.estimation.refinement import refine
from islands.models.latent import LatentModel
from islands.models.narx import require_narx
from islands.models.protocol import DynamicModel
from islands.progress import never_stop
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status

#: Estimators whose start is least squares, whatever the parameters are.
_REGRESSIONS = ("least-squares", "extended-least-squares")

#: Steps of a refinement, at most: the parameters of two records of one system are near each other.
_STEPS = 10


def refit(
    model: DynamicModel,
    criterion: Criterion,
    record: Dataset,
    constraints: str,
    warm_up: int,
    stop: Callable[[], bool] = never_stop,
) -> DynamicModel | EvaluationOutcome:
    """Estimate the parameters of a model again, by its own criterion and under its constraints.

    Parameters
    ----------
    model : DynamicModel
    criterion : Criterion
        Error that the parameters minimise.
    record : Dataset
        Signals of the model.
    constraints : str
        Statements of ``constraint``.
    warm_up : int
        Number of samples before the first prediction.
    stop : callable
        Whether to end a refinement with the parameters so far.

    Returns
    -------
    DynamicModel or EvaluationOutcome
        An equation has standard errors if the given one has them.
    """
    limits = constraints, warm_up
    if isinstance(model, LatentModel):
        return refit_latent(model, record, _STEPS, stop, constraints)
    if criterion.estimator in _REGRESSIONS:
        fitted = estimate(require_narx(model).regressors, record, *limits)
        if isinstance(fitted, FittedStructure):
            fitted = estimate_with(criterion.estimator, fitted, record, *limits)
        if isinstance(fitted, EvaluationOutcome):
            return fitted
        found: DynamicModel = fitted.model
    else:
        has_errors = model.standard_errors is not None
        refined = refine(
            model, record, criterion.interval, *limits, _STEPS, standard_errors=has_errors, stop=stop
        )
        if isinstance(refined, EvaluationOutcome):
            return refined
        found = refined.model
    if found.parameter_names != model.parameter_names:
        return EvaluationOutcome(Status.INFEASIBLE, "the constraints would remove a term")
    return model.with_parameters(found.parameters, found.standard_errors)
