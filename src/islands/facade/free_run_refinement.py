"""Estimation of the models of a fit by the error of their free runs.

Least squares of the error one step ahead is biased if the measured past outputs contain noise, and the bias
appears as superfluous terms. The models of the fit are the starts of the refinement. Of the model that is
then recommended, the term with the least t-ratio is removed while its parameter is within two standard errors
of zero. Least squares is kept where the free run gains little: it is efficient under white equation noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import LEAST_SQUARES, SIGNIFICANT, refinement_criterion
from islands.estimation.refinement import refine
from islands.estimation.structure_selection.deviations import LARGE_OFFSET, find_offsets
from islands.evolution.search_result import SearchResult, keep_best_of_sizes
from islands.expressions.tree import Constant
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.models.regressor import Regressor
from islands.parallel import map_over_record
from islands.progress import Steps
from islands.rounding import RESOLUTION
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import Assessment, assess

_FREE_RUN = refinement_criterion(None)

#: Name of the step.
REFINEMENT = "estimation by the error of the free run"

#: Largest error on the validation data, relative to the least, of a model that is refined.
_CLOSE = 2.0

#: Largest number of accepted steps of a refinement.
_STEPS = 30

#: Largest error of the recommended model relative to that of least squares, unless it has fewer terms.
_LARGEST_RATIO = 0.95


def refine_models(
    found: SearchResult, shooting: int, warm_up: int, constraints: str, steps: Steps
) -> tuple[SearchResult, list[Assessment]]:
    """Refine the least-squares models of a fit on the free run.

    Parameters
    ----------
    found : SearchResult
        Result at the rate of its split.
    shooting : int
        Length of a multiple-shooting interval in samples of the split.
    warm_up : int
        Number of samples before the first prediction.
    constraints : str
        Statements of ``constraint``.
    steps : Steps
        The refinement is an optional step.

    Returns
    -------
    SearchResult
        With the best model of every size. The given result if the recommended model has neither an error that
        is smaller by 5 % on the validation data, nor fewer terms and no larger error, or if a model of the
        given result is exact.
    list of Assessment
        All models that were refined; none if the given result is returned.
    """
    record = found.split.estimation
    is_far = any(find_offsets(record, constraints, LARGE_OFFSET))

    def refine_one(model: DynamicModel) -> Assessment | None:
        if steps.skip(REFINEMENT):
            return None
        refined = refine(model, record, _FREE_RUN.interval, constraints, warm_up, _STEPS)
        if isinstance(refined, EvaluationOutcome):
            return None
        return assess(refined.model, found.split, shooting, warm_up, constraints, _FREE_RUN)

    def eliminate(entry: Assessment | None) -> Iterator[Assessment]:
        while entry and (kept := _keep_significant(entry, is_far)):
            start = estimate(kept, record, constraints, warm_up, standard_errors=False)
            entry = None if isinstance(start, EvaluationOutcome) else refine_one(start.model)
            if entry:
                yield entry

    least = min(each.validation_error for each in found.models)
    if least <= RESOLUTION * found.split.validation.output_range:
        return found, []
    steps.report(REFINEMENT, None)
    limit = _CLOSE * least
    starts = [
        each.model
        for each in found.models
        if each.criterion == LEAST_SQUARES and each.validation_error <= limit
    ]
    added = [each for each in map_over_record(refine_one, starts, record.samples) if each]
    refined = _add_models(found, added)
    reduced: set[tuple[str, ...]] = set()
    while (names := refined.recommended.model.parameter_names) not in reduced:
        reduced.add(names)
        smaller = list(eliminate(refined.recommended))
        refined = _add_models(refined, smaller)
        added += smaller
    return (refined, added) if _is_better(refined.recommended, found.recommended) else (found, [])


def _add_models(found: SearchResult, models: Sequence[Assessment]) -> SearchResult:
    return replace(found, models=keep_best_of_sizes((*found.models, *models)))


def _keep_significant(entry: Assessment, is_far: bool) -> tuple[Regressor, ...]:
    """Return the regressors of a refined model without the least significant one.

    The constant of signals that are far from zero belongs to the unit, not to the law. Empty if every other
    parameter is significant, or if the parameters are not refined.
    """
    model = entry.model
    if entry.criterion != _FREE_RUN or not isinstance(model, Model) or model.standard_errors is None:
        return ()
    errors = np.array(model.standard_errors)
    if is_far:
        errors[[isinstance(item.expression, Constant) for item in model.regressors]] = 0.0
    # The parameter of an exact equation has no error.
    ratios = np.full(model.size, inf)
    np.divide(np.abs(model.parameters), errors, out=ratios, where=errors > 0.0)
    worst = int(np.argmin(ratios))
    return model.regressors[:worst] + model.regressors[worst + 1 :] if ratios[worst] < SIGNIFICANT else ()


def _is_better(entry: Assessment, reference: Assessment) -> bool:
    limit = _LARGEST_RATIO if entry.model.size >= reference.model.size else 1.0
    return entry.validation_error <= limit * reference.validation_error
