"""Fit of a class of models by the error of the free run, from the starting models of the class."""

from collections.abc import Iterator
from math import isfinite

from islands.errors import SettingsError
from islands.estimation.estimator_table import refinement_criterion
from islands.estimation.refinement import refine
from islands.evolution.presets import resolve_settings
from islands.evolution.search_result import (
    ResultCallback,
    SearchResult,
    SearchStatistics,
    add_models,
    as_candidate,
    complete_search,
    ignore_result,
    list_simple_models,
    rank_models,
)
from islands.evolution.search_state import SearchState
from islands.evolution.settings import LATENT, Settings
from islands.facade.fit_settings import FitSettings
from islands.facade.identification_progress import SEARCH
from islands.facade.latent_identification import search_latent
from islands.facade.results.model_simulation import SHOOTING
from islands.facade.trials.prepared_data import PreparedData
from islands.models.latent import LatentModel
from islands.models.parametric import ParametricModel
from islands.persistence.models import MODEL_CLASSES
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import assess

#: Largest number of accepted steps from a starting model.
_STEPS = 100

#: Every class is fitted by the error of the free run.
_CRITERION = refinement_criterion(None)


def fit_class(
    record: Dataset,
    split: Split,
    given: FitSettings,
    seed: int,
    steps: Steps,
    on_models: ResultCallback = ignore_result,
) -> SearchResult:
    """Fit the models of a class.

    Every starting model of the class is refined on the free run of the estimation data. The model with the
    least error is kept. Latent models are evolved instead (see `search_latent`).

    Parameters
    ----------
    record : Dataset
        Record as passed by the user, which the result contains.
    split : Split
        Estimation data and validation data at the rate of the record.
    given : FitSettings
        Its model is an entry of ``MODEL_CLASSES``.
    seed : int
        Stored in the result, and seed of its prediction bands.
    steps : Steps
    on_models : callable
        Called with the ranked models, before the optional steps.

    Raises
    ------
    SettingsError
        No model has a free run that remains bounded.
    """
    kind = given.model
    entry = MODEL_CLASSES[kind]
    interval = min(SHOOTING, max(1, split.estimation.samples // 10))
    if issubclass(entry, LatentModel):
        searched = resolve_settings(
            LATENT, {"structure": given.structure, "constraints": given.constraints or "none"}
        )

        def report(state: SearchState, settings: Settings) -> None:
            done, whole = state.archipelago.generation, settings.generations
            steps.report(f"{SEARCH}: generation {done} of {whole}", (done + 1) / (whole + 1))

        method = {"method": "fit"}
        data = PreparedData(split)
        latent, _ = search_latent(record, data, searched, seed, steps, method, on_epoch=report)
        return _complete(latent, steps, on_models)
    found = sorted(_estimate(entry, split.estimation, steps), key=lambda pair: pair[0])
    models = [model for _, model in found[:1]]
    if not models:
        raise SettingsError(
            f"no model {kind} was found: the record is too short, a column is constant, or the free run of "
            "every starting model diverges; take another record or another class"
        )
    steps.report("assessment of the models", 0.9)
    assessed = [assess(model, split, interval, criterion=_CRITERION) for model in models]
    settings = {"method": "fit", "model": kind, "constraints": "none", "average": 1, "shooting": interval}
    counts = {"ok": len(models)}
    search = SearchStatistics(len(models), counts, {"candidates": len(models), "bytes": 0})
    result = SearchResult(record, split, seed, settings, search, rank_models(assessed))
    return _complete(result, steps, on_models)


def _complete(found: SearchResult, steps: Steps, on_models: ResultCallback) -> SearchResult:
    """Return a complete result with the linear model of the same data."""
    constraints = str(found.settings["constraints"])
    linear = list_simple_models(found.split, found.shooting_interval, 0, constraints, steps)
    found = add_models(found, linear)
    on_models(found)
    return complete_search(found, list(map(as_candidate, found.models)), steps)


def _estimate(
    entry: type[ParametricModel], record: Dataset, steps: Steps
) -> Iterator[tuple[float, ParametricModel]]:
    """Yield the refined models with their mean squared errors."""
    for number, start in enumerate(entry.start(record), start=1):
        if number > 1 and steps.skip("estimation from further starting models"):
            return
        steps.report(f"estimation from starting model {number}", 0.0)
        refined = refine(start, record, _CRITERION.interval, max_steps=_STEPS)
        if not isinstance(refined, EvaluationOutcome) and isfinite(refined.after):
            yield refined.after, refined.model
