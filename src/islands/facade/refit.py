"""Estimation of the ranked models of a result on all data: estimation and validation data together.

The validation data rank and recommend models, and calibrate the bands. Once that is done, they may inform the
parameters, too. No data are left to measure the error of the new parameters: the errors of the result remain
those of the parameters before, which are an estimate of it.
"""

from dataclasses import replace
from functools import partial

from islands.estimation.constraints.checks import check_constraints
from islands.estimation.estimator_table import Criterion
from islands.estimation.quantity_errors import with_quantity_errors
from islands.estimation.refit import refit
from islands.evolution.search_result import SearchResult, state_steps
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.parallel import map_over_record
from islands.progress import Steps
from islands.records.averaging import average_samples
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset
from islands.records.missing_outputs import skip_missing_outputs
from islands.records.signal_map import map_signals
from islands.records.split import Split, join_parts
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import Assessment, with_refit
from islands.validation.recommendation import is_sound

#: Name of the step.
_REFIT = "estimation of the parameters on all data"

#: Reason of a discarded estimate.
_UNSOUND = "a physics check that the model passes would fail"

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
        stop = partial(steps.skip, _REFIT)
        estimated = refit(entry.model, criterion, data, constraints, entry.warm_up, stop)
        if isinstance(estimated, EvaluationOutcome):
            changed, reason = entry.model, f"the estimation fails ({estimated.reason})"
        else:
            changed, reason = estimated, _find_fault(entry, estimated, data, constraints)
            if isinstance(changed, LatentModel) and not reason:
                changed = with_quantity_errors(changed, data, entry.warm_up, constraints)
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
    return skip_missing_outputs(join_parts(Split(record, matched)))


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
