"""Estimation of the models of a fit by the error of their free runs.

Least squares of the error one step ahead is biased if the measured past outputs contain noise, and the bias
appears as superfluous terms. The models of the fit are the starts of the refinement. Least squares is kept
where the free run gains little: it is efficient under white equation noise. Of the model that is then
recommended, terms whose parameters are within two standard errors of zero are tried without.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import (
    LEAST_SQUARES,
    SIGNIFICANT,
    Criterion,
    refinement_criterion,
)
from islands.estimation.refinement import refine
from islands.estimation.structure_selection.deviations import LARGE_OFFSET, find_offsets
from islands.evolution.search_result import SearchResult, add_models
from islands.expressions.tree import Constant
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.models.regressor import Regressor
from islands.parallel import map_over_record
from islands.progress import Steps
from islands.rounding import RESOLUTION
from islands.simulation.initial_outputs import simulate_freely
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


def refine_models(found: SearchResult, warm_up: int, steps: Steps) -> tuple[SearchResult, list[Assessment]]:
    """Refine the least-squares models of a fit on the free run, and try the recommended one with fewer terms.

    Parameters
    ----------
    found : SearchResult
        Result at the rate of its split.
    warm_up : int
        Number of samples before the first prediction.
    steps : Steps
        The refinement is an optional step.

    Returns
    -------
    SearchResult
        With the best model of every size. The refined models are left out if the one that would be
        recommended has neither an error that is smaller by 5 % on the validation data, nor fewer terms and no
        larger error. It is the given result if a model of it is exact.
    list of Assessment
        All further models that were estimated.
    """
    reduction = _Reduction(found, warm_up, steps)
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
    samples = found.split.estimation.samples
    added = [each for each in map_over_record(reduction.refine, starts, samples) if each]
    refined, smaller = reduction.reduce(add_models(found, added))
    if _is_better(refined.recommended, found.recommended):
        return refined, [*added, *smaller]
    return reduction.reduce(found)


class _Reduction:
    """Removal of insignificant terms from the equations of a fit.

    Parameters
    ----------
    found : SearchResult
        Result at the rate of its split.
    warm_up : int
        Number of samples before the first prediction.
    steps : Steps
    """

    def __init__(self, found: SearchResult, warm_up: int, steps: Steps) -> None:
        self._split, self._shooting = found.split, found.shooting_interval
        self._limits = str(found.settings["constraints"]), warm_up
        self._steps = steps
        # The constant of signals that are far from zero belongs to the unit, not to the law.
        self._is_far = any(find_offsets(found.split.estimation, self._limits[0], LARGE_OFFSET))

    def refine(self, model: DynamicModel) -> Assessment | None:
        """Return a model with the least error of the free run; None without one."""
        if self._steps.skip(REFINEMENT):
            return None
        refined = refine(model, self._split.estimation, _FREE_RUN.interval, *self._limits, _STEPS)
        return None if isinstance(refined, EvaluationOutcome) else self._assess(refined.model, _FREE_RUN)

    def reduce(self, found: SearchResult) -> tuple[SearchResult, list[Assessment]]:
        """Return a result with smaller forms of its recommended model, and these forms.

        The term with the least t-ratio is removed while its parameter is within two standard errors of zero.
        If a smaller form is then recommended, it is tried as well.
        """
        added: list[Assessment] = []
        tried: set[tuple[str, ...]] = set()
        while (names := found.recommended.model.parameter_names) not in tried:
            tried.add(names)
            smaller = list(self._eliminate(found.recommended))
            found = add_models(found, smaller)
            added += smaller
        return found, added

    def _eliminate(self, entry: Assessment | None) -> Iterator[Assessment]:
        while entry and (kept := _keep_significant(entry, self._is_far)):
            entry = self._estimate(kept, entry)
            if entry:
                yield entry

    def _estimate(self, terms: tuple[Regressor, ...], larger: Assessment) -> Assessment | None:
        """Return a model with some terms of a larger one, whose free run has no noise and gives the start."""
        is_simulated, record = larger.criterion == _FREE_RUN, self._split.estimation
        if is_simulated:
            run = simulate_freely(larger.model, record, self._limits[1])
            record = replace(record, y=np.where(np.isnan(run.y), record.y, run.y))
        found = estimate(terms, record, *self._limits)
        if isinstance(found, EvaluationOutcome):
            return None
        return self.refine(found.model) if is_simulated else self._assess(found.model, LEAST_SQUARES)

    def _assess(self, model: DynamicModel, criterion: Criterion) -> Assessment:
        constraints, warm_up = self._limits
        return assess(model, self._split, self._shooting, warm_up, constraints, criterion)


def _keep_significant(entry: Assessment, is_far: bool) -> tuple[Regressor, ...]:
    """Return the regressors of an equation without the least significant one, apart from a constant.

    Empty if every other parameter is significant.
    """
    model = entry.model
    if not isinstance(model, Model) or model.standard_errors is None:
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
