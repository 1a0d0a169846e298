"""Comparison of latent models with the kind of NARX models that the preset ``auto`` has chosen."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

from islands.evolution.settings import LATENT, Settings
from islands.facade.automatic.choice import Choice
from islands.facade.automatic.kind_choice import measure_share, recommend_kind
from islands.facade.front import Front
from islands.facade.latent_identification import search_latent
from islands.facade.trials.prepared_data import PreparedData
from islands.models.form import is_linear
from islands.models.narx import Model
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.validation.assessment import Assessment
from islands.validation.predictable_residual import ADEQUATE

#: Settings of the short search that is compared.
LATENT_TRIAL: Mapping[str, Any] = MappingProxyType({"population": 16, "generations": 6, "islands": 1})

#: Message of the trial.
_TRIAL = "preset auto: trial of latent models"


def compare_latent(
    record: Dataset, front: Front, choice: Choice, settings: Settings, steps: Steps
) -> tuple[Choice, list[Assessment]]:
    """Choose latent models if their recommended model has more evidence than the equations of a front.

    They are not tried if no predictable part is left in the residual of the free run of the recommended
    model, since another one can then hardly be better. A stop ends the trial without an effect on the choice.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user.
    front : Front
        Models of the fits.
    choice : Choice
        Kind of NARX models.
    settings : Settings
        Settings of the search for latent models that is compared.
    steps : Steps

    Returns
    -------
    tuple of Choice and list of Assessment
        The choice, and the models of the trial.
    """
    found = front.found
    if found.recommended.residual_structure.verdict == ADEQUATE or steps.stop():
        return choice, []
    # The steps of the trial are part of the choice, and not steps of the search that follows.
    trial = Steps(lambda message, _=None: steps.report(f"{_TRIAL}, {message}", None), steps.stop)
    steps.report(_TRIAL, None)
    data = PreparedData(found.split, found.average)
    search = partial(search_latent, record, data, settings, 0, trial, {}, direct=data.is_early)
    tried = trial.attempt(_TRIAL, search)
    if tried is None:
        failed = [f"Latent models were not compared: {reason}." for reason in trial.not_computed.values()]
        return replace(choice, reasons=(*choice.reasons, *failed)), []
    if steps.stop():
        return choice, []
    latent, _ = tried
    compared = {LATENT: latent.recommended}
    equations = tuple(each for each in found.models if isinstance(each.model, Model))
    if equations:
        compared = {choice.kind: replace(found, models=equations).recommended} | compared
    bounded = {name: each for name, each in compared.items() if each.outcomes["validation"]["free_run"]}
    if LATENT not in bounded:
        return choice, list(latent.models)
    measured = {name: measure_share(each, found.split.estimation) for name, each in bounded.items()}
    kind, reason = recommend_kind(bounded, measured)
    choice = replace(choice, errors=MappingProxyType({**choice.errors, **measured}))
    # A linear model of the trial is no reason to evolve curves.
    if kind == LATENT and not is_linear(latent.recommended.model):
        sentence = f"Preset auto chose latent (state spaces with static curves), because {reason}."
        late = "Dead times are those of the linear model, or states."
        choice = replace(choice, kind=LATENT, delays=(), reasons=(sentence, late))
    return choice, list(latent.models)
