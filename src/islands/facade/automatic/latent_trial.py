"""Comparison of latent models with the kind of NARX models that the preset ``auto`` has chosen."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

from islands.evolution.settings import LATENT, Settings
from islands.facade.automatic.kind_choice import Choice, measure_share
from islands.facade.automatic.kind_trials import percent
from islands.facade.latent_identification import search_latent
from islands.facade.library_fit import LibraryFit
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.validation.assessment import Assessment, average_errors
from islands.validation.predictable_residual import ADEQUATE

#: Settings of the short search that is compared.
LATENT_TRIAL: Mapping[str, Any] = MappingProxyType({"population": 16, "generations": 6, "islands": 1})

#: Message of the trial.
_TRIAL = "preset auto: trial of latent models"

#: Largest error of latent models on the validation data, relative to that of the chosen kind.
_CLEARLY_BETTER = 0.8

#: Largest error on the estimation data, relative to that of the chosen kind, of latent models whose error on
#: the validation data is merely not larger.
_HALF = 0.5


def compare_latent(
    record: Dataset, split: Split, choice: Choice, fit: LibraryFit, settings: Settings, steps: Steps
) -> Choice:
    """Return the choice of latent models if they are clearly better than those of the chosen kind.

    They are not tried if no predictable part is left in the residual of the free run of the recommended
    model, since another one can then hardly be better. A stop ends the trial without an effect on the choice.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user.
    split : Split
        Estimation data and validation data at the rate of the record.
    choice : Choice
        Kind of NARX models.
    fit : LibraryFit
        Its fit.
    settings : Settings
        Settings of the search for latent models that is compared.
    steps : Steps
    """
    chosen = fit.found.recommended
    explained = chosen.residual_structure.verdict == ADEQUATE
    if explained or steps.stop():
        return choice
    # The steps of the trial are part of the choice, and not steps of the search that follows.
    trial = Steps(lambda message, _=None: steps.report(f"{_TRIAL}, {message}", None), steps.stop)
    steps.report(_TRIAL, None)
    found = trial.attempt(_TRIAL, partial(search_latent, record, split, settings, 0, trial, {}))
    if found is None:
        failed = [f"Latent models were not compared: {reason}." for reason in trial.not_computed.values()]
        return replace(choice, reasons=(*choice.reasons, *failed))
    latent = found.recommended
    if steps.stop() or not latent.outcomes["validation"]["free_run"]:
        return choice
    # Models of means and of samples are compared in means of equal length.
    ours, theirs = average_errors(latent, fit.average), chosen
    errors = {**choice.errors, choice.kind: measure_share(theirs, split.estimation)}
    errors[LATENT] = measure_share(ours, split.estimation)
    compared = replace(choice, errors=MappingProxyType(errors))
    if not _is_better(ours, theirs):
        return compared
    reason = (
        "Preset auto chose latent (state spaces with static curves), because the free-run RMSE of the "
        "recommended model of a short search on the validation data is "
        f"{percent(errors[LATENT])} of the output range of the estimation data, compared with "
        f"{percent(errors[choice.kind])} for {choice.kind}."
    )
    late = "Dead times are those of the linear model, or states."
    return replace(compared, kind=LATENT, delays=(), reasons=(reason, late))


def _is_better(latent: Assessment, chosen: Assessment) -> bool:
    if not chosen.outcomes["validation"]["free_run"]:
        return True
    if latent.validation_error <= _CLEARLY_BETTER * chosen.validation_error:
        return True
    ours, theirs = (each.metrics["estimation"]["free_run"].rmse for each in (latent, chosen))
    return latent.validation_error <= chosen.validation_error and ours <= _HALF * theirs
