"""Identify: evolution by MGGP/FROE, refinement, validation. Nobody has to guess the terms."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from typing import Any

from islands.data.dataset import Dataset
from islands.data.split import Split, split_data
from islands.errors import RecordError, SettingsError
from islands.estimation.estimate import estimate
from islands.estimation.refinement import refine
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import Engine, SerialEngine, Stop
from islands.evolution.gp.fitness import FITNESSES
from islands.evolution.gp.individual import make_regressor
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.presets import resolve_settings
from islands.evolution.problem import Problem, problem
from islands.evolution.search_result import RankedModel, SearchResult, SearchStatistics, rank_models
from islands.evolution.search_state import SearchState, advance, stop_reason
from islands.evolution.settings import Settings
from islands.facade.result import Result
from islands.io.result_folder import record_document
from islands.model.candidate_library import full_set
from islands.model.model import Model, canonical_order
from islands.model.regressor import Regressor
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run
from islands.validation.assessment import assess
from islands.validation.metrics import metrics

#: Outcomes of individuals that have a model.
FEASIBLE = ("ok", "abandoned")

#: Predictions on the validation data that a test of the residual takes.
_RESIDUALS = 3

#: Takes the state of a search after every epoch, and its settings.
SearchCallback = Callable[[SearchState, Settings], None]


def identify(
    record: Dataset,
    validation: Dataset | float = 0.25,
    *,
    preset: str = "hysteresis",
    seed: int = 0,
    progress: SearchCallback | None = None,
    stop: Stop | None = None,
    start: SearchState | None = None,
    engine: Engine | None = None,
    **changes: Any,
) -> Result:
    """Identify a record by evolution.

    Parameters
    ----------
    record : Dataset
        Complete.
    validation : Dataset or float
        A record of its own, or the share of the record's end, that selects among the hall of fame.
    preset : str
        An entry of ``PRESETS``.
    seed : int
        The same seed gives the same result, bit for bit.
    progress : callable, optional
        Called with the `SearchState` and the `Settings` after every epoch.
    stop : callable, optional
        Asked all the time; once it answers with true the search ends, and the result is the best so far.
    start : SearchState, optional
        Go on from here, as if never stopped.
    engine : Engine, optional
        Carries out the epochs; the serial one by default.
    **changes
        Settings that differ from the preset's: ``generations=100, islands=4``.

    Raises
    ------
    SettingsError
        A setting is unknown or out of range, or no model was found.
    RecordError
        The record is too short or incomplete, or the validation data does not fit it.
    """
    settings = resolve_settings(
        preset, {name: tuple(value) if isinstance(value, list) else value for name, value in changes.items()}
    )
    if seed < 0:
        raise SettingsError(f"a seed is not negative, got {seed}")
    split = split_data(record, validation)
    _refuse_short(split.validation, settings)
    posed = problem(split.estimation, settings)
    stop = stop or (lambda: False)
    state = start or SearchState(empty_archipelago(settings.islands, seed))
    if [(island.index, island.seed) for island in state.archipelago.islands] != [
        (index, seed) for index in range(settings.islands)
    ]:
        raise SettingsError("the start has other islands than the settings, or another seed: give its own")
    with closing((engine or SerialEngine()).run(posed, state.archipelago, stop)) as epochs:
        # What an engine has done beyond the epoch that ends a run is never asked for: it can't change it.
        while not (stop() or stop_reason(state, settings)) and (epoch := next(epochs, None)):
            state = advance(state, epoch)
            if progress is not None:
                progress(state, settings)
    if state.archipelago.generation < 0:
        raise SettingsError("stopped before the first populations were evaluated: there is no model to keep")
    models = final_models(state.archipelago.hall_of_fame, posed, split)
    if not models:
        raise SettingsError(
            f"no model was found: {dict(state.outcomes)}; take another preset, more generations or a longer "
            "record"
        )
    described = {"method": "identify", "preset": preset, **asdict(settings)}
    described["validation"] = record_document(validation) if isinstance(validation, Dataset) else validation
    return Result(SearchResult(record, split, seed, described, _search(state, posed), models))


def _refuse_short(validation: Dataset, settings: Settings) -> None:
    # Before the search: nobody wants to learn it after an hour.
    needed = settings.maximum_lag + _RESIDUALS
    if max(validation.segments) < needed:
        raise RecordError(
            f"the longest recording of the validation data has {max(validation.segments)} samples: with lags "
            f"down to {settings.maximum_lag} it takes {needed}; give more, or a smaller max_height"
        )


def final_models(hall: HallOfFame, posed: Problem, split: Split) -> tuple[RankedModel, ...]:
    """Validate the hall of fame and return the best model of every size, best first.

    Candidates are the hall's models as they were estimated, the same refined, and the structures that seeded
    the search: an evolution never returns worse than its seed. Under a constraint a model has to have
    Property 1; where none of a size has, the size is left out.
    """
    settings = posed.settings
    found: dict[int, list[tuple[float, Model]]] = {}
    for model in _candidates(hall, posed):
        simulated = free_run(model, split.validation, settings.maximum_lag)
        if simulated.outcome:
            rmse = metrics(split.validation.y, simulated.y).rmse
            found.setdefault(model.size, []).append((rmse, model))
    kept = []
    for entries in found.values():
        entries.sort(key=lambda entry: (entry[0], tuple(item.text for item in entry[1].regressors)))
        for _, model in entries:
            assessment = assess(model, split, settings.shooting, settings.maximum_lag)
            if settings.constraints == "none" or assessment.physics.property_1:
                kept.append(RankedModel(model, assessment))
                break
    return rank_models(kept)


def _candidates(hall: HallOfFame, posed: Problem) -> list[Model]:
    record, settings = posed.record, posed.settings
    interval = FITNESSES[settings.fitness](settings.shooting)
    structures: dict[tuple[Regressor, ...], None] = {entry.regressors: None for entry in hall.entries}
    for genes in posed.seeds:
        found = (item for gene in genes if (item := make_regressor(gene)))
        structures.setdefault(tuple(canonical_order(found)))
    models = []
    for structure in structures:
        estimated = estimate(structure, record, settings.constraints, settings.maximum_lag)
        if isinstance(estimated, EvaluationOutcome):
            continue
        models.append(estimated.model)
        if settings.refine:
            refined = refine(estimated.model, record, interval, settings.constraints, settings.maximum_lag)
            if not isinstance(refined, EvaluationOutcome):
                models.append(refined.model)
    return models


def _search(state: SearchState, posed: Problem) -> SearchStatistics:
    deepest, degree = _reach(state.archipelago.hall_of_fame)
    inputs = posed.record.inputs
    count = full_set(degree, deepest, deepest, inputs)
    rows = sum(max(0, length - posed.settings.maximum_lag) for length in posed.record.segments)
    return SearchStatistics(
        state.evaluations,
        dict(state.outcomes),
        {"candidates": count, "bytes": 8 * count * rows, "degree": degree, "lags": deepest},
        None,
        state.archipelago.generation,
        state.duplicates,
        sum(state.outcomes.get(name, 0) for name in FEASIBLE) / max(1, state.evaluations),
        state.history,
        state.caches,
        stop_reason(state, posed.settings) or "stopped",
    )


def _reach(hall: HallOfFame) -> tuple[int, int]:
    """Return the deepest lag and the highest number of factors that the hall's models use."""
    regressors = [item for entry in hall.entries for item in entry.regressors]
    deepest = max((item.maximum_lag for item in regressors), default=1)
    return max(1, deepest), max((item.degree for item in regressors), default=1)
