"""Estimation of the ranked models of a result on all data: estimation and validation data together.

The validation data rank and recommend models, and calibrate the bands. Once that is done, they may inform the
parameters, too. No data are left to measure the error of the new parameters: the errors of the result remain
those of the parameters before, which are an estimate of it.
"""

from dataclasses import replace
from functools import partial

from islands.estimation.constraints.checks import check_constraints
from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.estimator_table import Criterion
from islands.estimation.estimators import estimate_with
from islands.estimation.latent_refit import refit_latent
from islands.estimation.quantity_errors import with_quantity_errors
from islands.estimation.refinement import RefinedModel, refine
from islands.evolution.search_result import SearchResult, state_steps
from islands.models.latent import LatentModel
from islands.models.narx import Model, require_narx
from islands.models.protocol import DynamicModel
from islands.parallel import map_over_record
from islands.progress import Steps
from islands.records.averaging import average_samples
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset, join
from islands.records.missing_outputs import skip_missing_outputs
from islands.records.signal_map import map_signals
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import Assessment, with_refit
from islands.validation.recommendation import is_sound

#: Name of the step.
_REFIT = "estimation of the parameters on all data"

#: Estimators whose start is least squares, whatever the parameters are.
_REGRESSIONS = ("least-squares", "extended-least-squares")

#: Reason of a discarded estimate.
_UNSOUND = "a physics check that the model passes would fail"

#: Steps of a refinement, at most: the parameters of the estimation data are near those of all data.
_STEPS = 10

#: Largest increase of the free-run RMSE on all data, as a fraction. Least squares does not minimise that
#: error: of a law under white equation noise, parameters that are nearer to the truth increase it by chance,
#: in half of the records and by up to 4 %. Biased least squares increases it by more.
_LARGEST_INCREASE = 0.05


def refit_models(found: SearchResult, validation: Dataset | float, steps: Steps) -> SearchResult:
    """Estimate the parameters of all models of a result on all data, if its settings ask for it.

    Each model keeps its structure, its constraints and its criterion. New parameters are discarded if they do
    not meet the constraints, if their free run diverges, or if its error on all data is clearly larger.

    Parameters
    ----------
    found : SearchResult
        Complete result, whose models state the number of samples of a mean.
    validation : Dataset or float
        The validation data as passed by the user: a record, or a fraction of the record of the result.
    steps : Steps
        The estimation is an optional step: models that it does not reach keep their parameters.
    """
    if found.settings.get("refit", "none") != "all":
        return found
    steps.report(_REFIT, None)
    constraints = str(found.settings["constraints"])
    for each in found.search.left_out:
        steps.leave_out(each)
    whole = steps.attempt(_REFIT, lambda: average_samples(join_data(found.record, validation), found.average))
    if whole is None:
        return state_steps(found, steps)

    def refit_one(entry: Assessment) -> Assessment:
        if entry.criterion is None:
            return entry
        return steps.attempt(_REFIT, partial(estimate_again, entry, entry.criterion)) or entry

    def estimate_again(entry: Assessment, criterion: Criterion) -> Assessment:
        data = match_record(entry.model, whole)
        estimated = _estimate(entry, criterion, data, constraints, steps)
        if isinstance(estimated, str):
            changed, reason = entry.model, estimated
        elif isinstance(estimated, LatentModel):
            reason = _find_fault(entry, estimated, data, constraints)
            changed = estimated
            if not reason:
                changed = with_quantity_errors(estimated, data, entry.warm_up, constraints)
        else:
            changed = entry.model.with_parameters(estimated.parameters, estimated.standard_errors)
            reason = _find_fault(entry, changed, data, constraints)
        made = with_refit(entry, changed, data.samples, reason, found.split, constraints)
        # A recommendation states the checks that a model passes.
        passes = [is_sound(each, found.requires_property_1) for each in (entry.physics, made.final_physics)]
        if passes == [True, False]:
            return with_refit(entry, changed, data.samples, _UNSOUND, found.split, constraints)
        return made

    models = tuple(map_over_record(refit_one, found.models, whole.samples))
    return state_steps(replace(found, models=models), steps)


def join_data(record: Dataset, validation: Dataset | float) -> Dataset:
    """Return estimation and validation data as one record, without the samples that have no output.

    A fraction was recorded without a pause, so that every recording is one piece again. No prediction reaches
    from one record into another.
    """
    if not isinstance(validation, Dataset):
        return skip_missing_outputs(record)
    columns = ColumnReference(record.input_names, record.output_name, record.dt, 1, record.preprocessing)
    matched, _ = map_signals(columns, validation)
    names = {
        name: getattr(record, name)
        for name in ("input_names", "output_name", "input_units", "output_unit", "preprocessing")
    }
    return skip_missing_outputs(join((record, replace(matched, **names))))


def _estimate(
    entry: Assessment, criterion: Criterion, data: Dataset, constraints: str, steps: Steps
) -> DynamicModel | str:
    """Return a model with the parameters that minimise its criterion; a reason if there are none."""
    model, limits = entry.model, (constraints, entry.warm_up)
    stop = partial(steps.skip, _REFIT)
    if isinstance(model, LatentModel):
        refitted = refit_latent(model, data, _STEPS, stop, constraints)
        return refitted if isinstance(refitted, LatentModel) else f"the estimation fails ({refitted.reason})"
    found: FittedStructure | RefinedModel[DynamicModel] | EvaluationOutcome
    if criterion.estimator in _REGRESSIONS:
        found = estimate(require_narx(model).regressors, data, *limits)
        if isinstance(found, FittedStructure):
            found = estimate_with(criterion.estimator, found, data, *limits)
    else:
        has_errors = model.standard_errors is not None
        found = refine(
            model, data, criterion.interval, *limits, _STEPS, standard_errors=has_errors, stop=stop
        )
    if isinstance(found, EvaluationOutcome):
        return f"the estimation fails ({found.reason})"
    if found.model.parameter_names != model.parameter_names:
        return "the constraints would remove a term"
    return found.model


def _find_fault(entry: Assessment, changed: DynamicModel, data: Dataset, constraints: str) -> str:
    """Return why changed parameters are not kept; empty if they are."""
    is_checked = isinstance(changed, Model | LatentModel)
    if is_checked and not all(each.met for each in check_constraints(changed, constraints)):
        return "the constraints would not be met"
    before, after = (simulate_freely(each, data, entry.warm_up) for each in (entry.model, changed))
    if not after.outcome:
        return "the free run would diverge"
    error, least = after.mean_squared_error**0.5, before.mean_squared_error**0.5
    if not before.outcome or error <= (1.0 + _LARGEST_INCREASE) * least:
        return ""
    return f"the free-run RMSE on all data would increase from {least:.4g} to {error:.4g}"
