"""Identification of latent models: state spaces with static units, evolved on the islands."""

from collections import Counter
from typing import Any

from islands.errors import SettingsError
from islands.estimation.estimator_table import refinement_criterion
from islands.estimation.fitted_state_space import FittedStateSpace
from islands.estimation.latent_data import make_latent_data
from islands.estimation.latent_models import estimate_models, find_front, meet_conditions
from islands.evolution.engine import Engine
from islands.evolution.latent_problem import LatentProblem, make_latent_problem
from islands.evolution.presets import LATENT_SETTINGS
from islands.evolution.search_result import (
    SearchResult,
    SearchStatistics,
    as_candidate,
    rank_models,
)
from islands.evolution.search_state import SearchState, stop_reason
from islands.evolution.settings import Settings
from islands.facade.engine_choice import Ray, open_engine
from islands.facade.evolution_run import SearchCallback, begin_search, evolve, ignore_epoch
from islands.facade.results.model_simulation import SHOOTING
from islands.facade.trials.prepared_data import PreparedData
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs
from islands.records.split import Split
from islands.validation.assessment import assess
from islands.validation.ensemble import ValidatedModel

#: Gain of the held-out error, as a fraction, that justifies a larger model of the result, and most models.
_GAIN, _MOST_MODELS = 0.15, 10

#: Latent models are estimated by the error of the free run.
_CRITERION = refinement_criterion(None)


def search_latent(
    record: Dataset,
    data: PreparedData,
    settings: Settings,
    seed: int,
    steps: Steps,
    described: dict[str, Any],
    *,
    direct: bool = True,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    on_epoch: SearchCallback = ignore_epoch,
) -> tuple[SearchResult, list[ValidatedModel[DynamicModel]]]:
    """Search latent models of a record by evolution.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user, which the result contains.
    data : PreparedData
    settings : Settings
        Settings of latent models.
    seed : int
    steps : Steps
    described : dict
        Settings of the result; those of the search are added.
    direct : bool
        Whether the output may read an input of the same sample. If it does, all inputs are read early.
    start, engine, on_epoch
        As for `identify`.

    Raises
    ------
    SettingsError
        No model was found.

    Returns
    -------
    SearchResult
        Without standard errors and prediction bands.
    list of ValidatedModel
        Its models, from which an ensemble is made.
    """
    split = data.split
    problem = make_latent_problem(split.estimation, settings, steps)
    if not problem.linear:
        raise SettingsError(
            "no latent model was found: the record is too short, or a column is constant or depends on "
            "others; take another record or another class"
        )
    state = begin_search(start, settings.islands, seed)
    with open_engine(engine, steps.report) as opened:
        state = evolve(problem, state, settings, opened, steps, on_epoch)
    models, infeasible = _estimate(problem, state, steps, direct)
    if not models:
        raise SettingsError(
            f"no latent model meets the constraints {settings.constraints!r}: the statements exclude each "
            "other, or need a nonlinear model that was not found; correct them, or take more generations"
        )
    if any(each.reads_at_once for each in models):
        split = Split(advance_all_inputs(split.estimation), advance_all_inputs(split.validation))
    steps.report("assessment of the models", 0.9)
    interval = min(SHOOTING, max(1, split.estimation.samples // 10))
    assessed = [
        assess(model, split, interval, constraints=settings.constraints, criterion=_CRITERION)
        for model in models
    ]
    described |= {name: getattr(settings, name) for name in sorted(LATENT_SETTINGS)}
    described |= {"average": data.average, "shooting": interval * data.average}
    search = SearchStatistics(
        state.evaluations,
        dict(Counter(state.outcomes) + Counter(infeasible=infeasible)),
        {"candidates": state.evaluations, "bytes": 0},
        None,
        state.archipelago.generation,
        state.duplicates,
        state.outcomes.get("ok", 0) / max(1, state.evaluations),
        state.history,
        state.caches,
        stop_reason(state, settings) or "stopped",
    )
    ranked = rank_models(assessed)
    found = SearchResult(record, split, seed, described, search, ranked, average=data.average)
    return found, list(map(as_candidate, ranked))


def _estimate(
    problem: LatentProblem, state: SearchState, steps: Steps, direct: bool
) -> tuple[list[LatentModel], int]:
    """Estimate the models of the front of size and held-out error, under the constraints.

    Return also the number of systems that cannot meet the constraints.
    """
    entries = state.archipelago.hall_of_fame.entries
    evolved = [each for each in entries if isinstance(each, FittedStateSpace)]
    # The linear systems may be part of the hall of fame.
    found, constraints = list(dict.fromkeys([*problem.linear, *evolved])), problem.settings.constraints
    feasible = meet_conditions(found, make_latent_data(problem.record, constraints), steps)
    front = find_front(feasible, _GAIN)[-_MOST_MODELS:]
    models = estimate_models(front, problem.record, steps, constraints, direct=direct)
    return models, len(found) - len(feasible)
