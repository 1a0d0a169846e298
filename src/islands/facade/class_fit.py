"""Fit of a class of models by the error of the free run, from the starting models of the class."""

from collections.abc import Iterator
from math import isfinite

from islands.data.dataset import Dataset
from islands.data.split import Split
from islands.errors import SettingsError, lookup
from islands.estimation.estimator_table import refinement_criterion
from islands.estimation.refinement import refine
from islands.evolution.search_result import SearchResult, SearchStatistics, rank_models, with_bands
from islands.facade.results.model_simulation import SHOOTING
from islands.io.models import MODEL_CLASSES, NARX
from islands.models.parametric import ParametricModel
from islands.progress import Steps
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run
from islands.validation.assessment import assess
from islands.validation.ensemble import ValidatedModel

#: Largest number of accepted steps from a starting model.
_STEPS = 100

#: Every class is fitted by the error of the free run.
_CRITERION = refinement_criterion(None)


def fit_class(record: Dataset, split: Split, kind: str, seed: int, steps: Steps) -> SearchResult:
    """Fit the models of a class.

    Every starting model of the class is refined on the free run of the estimation data. The model with the
    least error is kept.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user, which the result contains.
    split : Split
        Estimation data and validation data at the rate of the record.
    kind : str
        An entry of ``MODEL_CLASSES``.
    seed : int
        Stored in the result, and seed of its prediction bands.
    steps : Steps

    Raises
    ------
    SettingsError
        There is no such class, or no starting model has a free run that remains bounded.
    """
    lookup(dict.fromkeys((NARX, *MODEL_CLASSES)), kind, "class of models")
    entry = MODEL_CLASSES[kind]
    interval = min(SHOOTING, max(1, split.estimation.samples // 10))
    found = list(_estimate(entry, split.estimation, steps))
    if not found:
        raise SettingsError(
            f"no model {kind} was found: the free run of every starting model diverges; take another class, "
            "or scale the record"
        )
    _, model = min(found, key=lambda pair: pair[0])
    steps("assessment of the model", 0.9)
    assessment = assess(model, split, interval, criterion=_CRITERION)
    settings = {"method": "fit", "model": kind, "constraints": "none", "average": 1, "shooting": interval}
    counts = {"ok": len(found)}
    search = SearchStatistics(len(found), counts, {"candidates": len(found), "bytes": 0})
    result = SearchResult(record, split, seed, settings, search, rank_models([assessment]))
    error = free_run(model, split.validation).mean_squared_error
    return with_bands(result, [ValidatedModel(model, _CRITERION, error)], "none", model.maximum_lag, steps)


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
