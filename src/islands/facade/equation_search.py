"""Search for equations (NARX models) by evolution, from the islands to the assessed models."""

from dataclasses import fields, replace
from typing import Any

from islands.errors import RecordError, SettingsError
from islands.estimation.structure_selection.deviations import (
    LARGE_OFFSET,
    SHIFTABLE,
    Offsets,
    find_offsets,
    no_offsets,
    subtract_offsets,
)
from islands.evolution.engine import Engine
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import require_genes
from islands.evolution.problem import Problem, make_problem
from islands.evolution.search_result import SearchResult, SearchStatistics
from islands.evolution.search_state import SearchState, stop_reason
from islands.evolution.settings import Settings
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.expressions.user_primitive import get_source
from islands.facade.engine_choice import Ray, open_engine
from islands.facade.evolution_run import SearchCallback, begin_search, evolve, ignore_epoch
from islands.facade.final_models import Candidate, estimate_candidates, select_final_models
from islands.facade.trials.prepared_data import PreparedData
from islands.models.candidate_library import full_set
from islands.program.primitive_functions import row_address
from islands.progress import Steps, StoppedError
from islands.records.averaging import count_means
from islands.records.dataset import Dataset

#: Outcomes of individuals with estimated parameters.
FEASIBLE_OUTCOMES = ("ok", "abandoned")

#: Smallest number of predictions on the validation data that the residual tests need.
_MIN_RESIDUALS = 3


def count_needed(settings: Settings) -> int:
    """Return the fewest samples of a recording that permit a search."""
    return settings.maximum_lag + _MIN_RESIDUALS


def search_equations(
    record: Dataset,
    data: PreparedData,
    settings: Settings,
    seed: int,
    steps: Steps,
    described: dict[str, Any],
    *,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    on_epoch: SearchCallback = ignore_epoch,
) -> tuple[SearchResult, list[Candidate]]:
    """Search equations for a record by evolution.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user, which the result contains.
    data : PreparedData
    settings : Settings
    seed : int
    steps : Steps
    described : dict
        Settings of the result; those of the search are added.
    start, engine, on_epoch
        As for `identify`.

    Returns
    -------
    SearchResult
        The best model of every size, without prediction bands.
    list of Candidate
        All models that were estimated.

    Raises
    ------
    StoppedError
        A stop was requested before the first models were found.
    SettingsError
        No model was found.
    RecordError
        The validation data are too short.
    """
    split, count = data.split, data.average
    for entry in _own_primitives(settings):
        row_address(entry)  # compile it before the search starts
    _check_validation_length(split.validation, settings)
    offsets = _find_search_offsets(split.estimation, settings)
    scaled = replace(
        settings,
        shooting=count_means(settings.shooting, count),
        library_delays=tuple(delay // count for delay in settings.library_delays),
    )
    search_problem = replace(
        make_problem(subtract_offsets(split.estimation, offsets), scaled, steps), offsets=offsets
    )
    state = begin_search(start, settings.islands, seed)
    with open_engine(engine, steps.report) as opened:
        state = evolve(search_problem, state, settings, opened, steps, on_epoch)
    if state.archipelago.generation < 0 and not search_problem.seeds:
        raise StoppedError("first populations")
    hall_of_fame = state.archipelago.hall_of_fame
    candidates = estimate_candidates(hall_of_fame, search_problem, split, offsets, steps)
    steps.report("assessment of the final models", 1.0)
    models = select_final_models(candidates, search_problem, split, steps)
    if not models:
        raise SettingsError(
            f"no model was found: {dict(state.outcomes)}; take another preset, more generations or a longer "
            "record"
        )
    statistics = _make_statistics(state, hall_of_fame, search_problem)
    described |= _describe(settings)
    return SearchResult(record, split, seed, described, statistics, models, average=count), candidates


def _own_primitives(settings: Settings) -> list[Primitive]:
    return [entry for name, entry in settings.primitive_table.items() if name not in PRIMITIVES]


def _describe(settings: Settings) -> dict[str, Any]:
    """Return settings as JSON values. The source of each primitive of the user is in ``own_primitives``."""
    document = {each.name: getattr(settings, each.name) for each in fields(settings)}
    document["primitives"] = tuple(
        entry.name if isinstance(entry, Primitive) else entry for entry in settings.primitives
    )
    if own := _own_primitives(settings):
        document["own_primitives"] = {entry.name: get_source(entry) for entry in own}
    return document


def _check_validation_length(validation: Dataset, settings: Settings) -> None:
    # Check before the search starts, not after it.
    needed = settings.maximum_lag + _MIN_RESIDUALS
    if max(validation.segments) < needed:
        raise RecordError(
            f"the longest recording of the validation data has {max(validation.segments)} samples: lags up "
            f"to {settings.maximum_lag} need {needed}; give more data or a smaller max_height"
        )


def _find_search_offsets(record: Dataset, settings: Settings) -> Offsets:
    # A function such as a square root of a deviation differs from that of the signal.
    is_shiftable = SHIFTABLE.issuperset(settings.primitives)
    return find_offsets(record, settings.constraints, LARGE_OFFSET) if is_shiftable else no_offsets(record)


def _make_statistics(state: SearchState, hall_of_fame: HallOfFame, problem: Problem) -> SearchStatistics:
    maximum_lag, degree = _maximum_lag_and_degree(hall_of_fame)
    inputs = problem.record.inputs
    count = full_set(degree, maximum_lag, maximum_lag, inputs)
    rows = sum(max(0, length - problem.settings.maximum_lag) for length in problem.record.segments)
    return SearchStatistics(
        state.evaluations,
        dict(state.outcomes),
        {"candidates": count, "bytes": 8 * count * rows, "degree": degree, "lags": maximum_lag},
        None,
        state.archipelago.generation,
        state.duplicates,
        sum(state.outcomes.get(name, 0) for name in FEASIBLE_OUTCOMES) / max(1, state.evaluations),
        state.history,
        state.caches,
        stop_reason(state, problem.settings) or "stopped",
    )


def _maximum_lag_and_degree(hall_of_fame: HallOfFame) -> tuple[int, int]:
    """Return the largest lag and the largest degree of a regressor in the hall of fame."""
    regressors = [item for entry in hall_of_fame.entries for item in require_genes(entry).regressors]
    maximum_lag = max((item.maximum_lag for item in regressors), default=1)
    return max(1, maximum_lag), max((item.degree for item in regressors), default=1)
