"""Search of several outputs by the states that they share, with a result for every output."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from islands.estimation.estimator_table import refinement_criterion
from islands.estimation.linear.identify import LARGEST_ORDER
from islands.estimation.shared_states import search_shared_models
from islands.evolution.search_result import (
    BANDS,
    SearchResult,
    SearchStatistics,
    rank_models,
    require_one_output,
    state_steps,
)
from islands.evolution.settings import LATENT
from islands.facade.coupled.selection import NEGLIGIBLE_EXCESS
from islands.facade.results.identification import Result
from islands.facade.results.model_simulation import SHOOTING
from islands.progress import Steps
from islands.records.coupled import CoupledSplit
from islands.records.input_lead import advance_all_inputs
from islands.records.split import Split
from islands.report.documents.result_folder import record_document
from islands.validation.assessment import Assessment, assess
from islands.validation.ensemble import Ensemble, EnsembleStructure
from islands.validation.prediction_bands import calibrate_bands

#: The models are estimated by the error of the free run.
_CRITERION = refinement_criterion(None)


def search_large_system(
    data: CoupledSplit, described: Mapping[str, Any], options: Mapping[str, Any], seed: int, steps: Steps
) -> list[Result]:
    """Search a state space of more states than a separate search of one output can find.

    Parameters
    ----------
    data, described, options, seed, steps
        As for `search_shared_states`.
    """
    return search_shared_states(data, described, options, seed, steps, LARGEST_ORDER + 1)


def search_shared_states(
    data: CoupledSplit,
    described: Mapping[str, Any],
    options: Mapping[str, Any],
    seed: int,
    steps: Steps,
    least_order: int = 0,
) -> list[Result]:
    """Search a state space of all outputs; return the result of every output.

    The model with an effect of the amplitude is taken if its error on the validation data is much smaller
    than that of the linear one.

    Parameters
    ----------
    data : CoupledSplit
    described : mapping
        Settings of the results.
    options : mapping
        Settings of the search; a state space of several outputs meets no constraints.
    seed : int
    steps : Steps
    least_order : int
        A state space of a smaller order is no result.

    Returns
    -------
    list of Result
        Empty if the record shows no state space; see `search_shared_models`.
    """
    if options.get("constraints", "none") != "none" or steps.stop():
        return []
    found = search_shared_models(data.estimation, seed, steps, least_order)
    if not found:
        return []
    if found[0][0].reads_at_once:
        data = data.map(advance_all_inputs)
    splits = [Split(*pair) for pair in zip(data.estimation.records, data.validation.records, strict=True)]
    interval = min(SHOOTING, max(1, data.estimation.samples // 10))
    steps.report("assessment of the state spaces with shared states", 0.7)
    assessed = [
        [
            assess(model, split, interval, criterion=_CRITERION)
            for model, split in zip(models, splits, strict=True)
        ]
        for models in found
    ]
    linear, best = assessed[0], assessed[-1]
    if not _measure_error(best) < _measure_error(linear) / (1.0 + NEGLIGIBLE_EXCESS):
        best = linear
    statistics = SearchStatistics(len(found), {"ok": len(found)}, {"candidates": len(found), "bytes": 0})
    settings = {**described, "model": LATENT, "constraints": "none", "average": 1, "shooting": interval}
    results = []
    for record, split, entry, other in zip(data.estimation.records, splits, best, linear, strict=True):
        models = rank_models([entry] if entry is other else [entry, other])
        own = {**settings, "validation": record_document(split.validation)}
        result = SearchResult(record, split, seed, own, statistics, models)
        results.append(Result.from_search(_with_bands(result, steps)))
    return results


def measure_results(results: Sequence[Result]) -> float:
    """Return the error of the recommended models on the validation data; see `_measure_error`."""
    return _measure_error([require_one_output(each.search_result).recommended for each in results])


def _measure_error(assessed: Sequence[Assessment]) -> float:
    """Return the root mean square of the errors of the outputs, relative to their ranges.

    Infinite after a divergence.
    """
    errors = [each.metrics["validation"]["free_run"].mape for each in assessed]
    return float(np.sqrt(np.mean(np.square(errors)))) if np.isfinite(errors).all() else inf


def _with_bands(found: SearchResult, steps: Steps) -> SearchResult:
    """Return a result with bands about its model, whose parameters are the only member of the ensemble.

    A bootstrap of all parameters of a large system would take much longer than its estimation.
    """
    model, warm_up = found.recommended.final_model, found.recommended.warm_up
    ensemble = Ensemble((EnsembleStructure(model, 1.0, np.array([model.parameters])),))

    def compute() -> SearchResult:
        bands = calibrate_bands([each.final_model for each in found.models], ensemble, found.split, warm_up)
        pairs = zip(found.models, bands, strict=True)
        return replace(
            found, models=tuple(replace(each, bands=own) for each, own in pairs), ensemble=ensemble
        )

    return state_steps(steps.attempt(BANDS, compute) or found, steps)
