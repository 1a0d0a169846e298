"""Final models of a search: structures are screened on the validation data, then refined and assessed."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from math import inf, isfinite
from typing import Protocol, TypeAlias, TypeVar

from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.estimator_table import (
    LEAST_SQUARES,
    Criterion,
    make_criterion,
    refinement_criterion,
)
from islands.estimation.estimators import estimate_with
from islands.estimation.parameter_constraints import constraint
from islands.estimation.refinement import Refinement, begin_refinement, refine
from islands.estimation.structure_selection.deviations import Offsets, add_offsets, subtract_offsets
from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import Individual, require_genes, unique_structures
from islands.evolution.problem import Problem
from islands.evolution.search_result import rank_models
from islands.evolution.settings import FITNESSES, Settings
from islands.models.narx import require_narx
from islands.models.protocol import DynamicModel
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run_error, multiple_shooting
from islands.validation.assessment import Assessment, assess
from islands.validation.ensemble import ValidatedModel, measure_square

#: Model of one output that a search has found.
Candidate: TypeAlias = ValidatedModel[DynamicModel]

#: Structures of every size whose parameters are refined: the best by validation error and by fitness.
_REFINED = (8, 8)

#: Lengths of the intervals of further refinements, relative to the setting ``shooting``. Short intervals
#: weigh fast transients, long ones slow drift; the error on all data decides.
_INTERVALS = (0.3, 3.0)

#: Structures of every size that are refined over all intervals.
_MOST_PROMISING = 3

#: Steps of a refinement before the worse half of the models of a size is left, the largest number of steps,
#: and models that always take all steps.
_RACE_STEPS, _MAX_STEPS, _FINALISTS = 3, 30, 4

#: A model whose last step reduced the mean square by more than this fraction is not left.
_GAINING = 0.05

#: Once a stop is requested: samples of all models that are still assessed, and of all models of one size
#: that are still simulated on the validation data, at most; one model always is. Each takes half a second.
_ASSESSED_SAMPLES, _SCREENED_SAMPLES = 250_000, 1_500_000

#: Time of the final estimation of a size for each sample and each square of the size, relative to the part
#: that depends on neither. Of 20 000 samples, 15 terms take 2.6 s and one takes 0.1 s.
_SQUARE_SECONDS = 5e-6

#: Name of the step that refines parameters.
_REFINEMENT = "refinement of parameters"


class _HasSize(Protocol):
    @property
    def size(self) -> int: ...


_Sized = TypeVar("_Sized", bound=_HasSize)


def select_final_models(
    candidates: Iterable[Candidate], problem: Problem, split: Split, steps: Steps
) -> tuple[Assessment, ...]:
    """Assess the candidates and return the best model of every size, best first.

    The best model is that with the least error on all data or, if the settings select by fitness, on the
    estimation data. If the parameters are constrained, a model must have Property 1; a size without
    such a model is left out. Once a stop is requested, the remaining models have no standard errors, and of a
    long record only the sizes with the least errors are assessed.
    """
    settings = problem.settings
    most = max(1, _ASSESSED_SAMPLES // (split.estimation.samples + split.validation.samples))
    kept: list[Assessment] = []
    groups = _group_by_size(candidates)
    for entries in sorted(groups, key=lambda group: min(entry.order for entry in group)):
        if len(kept) >= most and steps.skip("assessment of further models"):
            break
        for candidate in _order_candidates(entries, settings, split.estimation):
            model = candidate.model
            if model.standard_errors is None:
                compute = partial(_with_standard_errors, candidate, settings, split.estimation)
                model = steps.attempt("standard errors", compute) or model
            assessment = assess(
                *(model, split, settings.shooting, settings.maximum_lag, settings.constraints),
                candidate.criterion,
            )
            if _is_valid(assessment, settings):
                kept.append(assessment)
                break
    return rank_models(kept)


def _order_candidates(candidates: list[Candidate], settings: Settings, record: Dataset) -> list[Candidate]:
    """Return the candidates in the order of the error that selects them, least first."""
    if settings.select != "fitness":
        return sorted(candidates, key=lambda entry: entry.order)
    interval = FITNESSES[settings.fitness](settings.shooting)

    def order(
        candidate: Candidate,
    ) -> tuple[float, tuple[float, tuple[str, ...], tuple[float, ...]]]:
        run = multiple_shooting(candidate.model, record, interval, settings.maximum_lag)
        return run.mean_squared_error, candidate.order

    return sorted(candidates, key=order)


def _with_standard_errors(candidate: Candidate, settings: Settings, record: Dataset) -> DynamicModel:
    """Return the model with standard errors; most candidates do not need them, so they have none."""
    model = candidate.model
    limits = settings.constraints, settings.maximum_lag
    if candidate.criterion.interval == 1:
        estimated = estimate(require_narx(model).regressors, record, *limits)
        if not isinstance(estimated, EvaluationOutcome) and estimated.model.parameters == model.parameters:
            return estimated.model
    refined = refine(model, record, candidate.criterion.interval, *limits, max_steps=0)
    return model if isinstance(refined, EvaluationOutcome) else refined.model


def _is_valid(assessment: Assessment, settings: Settings) -> bool:
    """Return whether a model meets the constraints; hysteresis also requires stable equilibria."""
    property_1 = assessment.physics.property_1 or not constraint(settings.constraints).sums
    return property_1 and all(check.met for check in assessment.constraints)


def estimate_candidates(
    hall_of_fame: HallOfFame,
    problem: Problem,
    split: Split,
    offsets: Offsets,
    steps: Steps,
) -> list[Candidate]:
    """Estimate and refine the best structures of every size, and validate them.

    Structures are those of the hall of fame and those that seeded the search, so that the result is never
    worse than the seeds. All of them are simulated on the validation data with the parameters of the search.
    The best of every size are estimated again in the units of the record and, if the settings ask for it,
    refined over several shooting intervals. An estimator in the settings replaces both. Once a stop
    is requested, the best structure of every remaining size is estimated only; of a long record, the fittest
    structures alone are compared. Models whose free run diverges are left out, unless
    the settings select by fitness.
    """
    settings, validation = problem.settings, subtract_offsets(split.validation, offsets)
    found = []
    groups = _group_by_size(_evaluate_structures(hall_of_fame, problem))
    completed = completed_parts([group[0].size for group in groups], split.estimation.samples)
    for done, group in zip(completed, groups, strict=True):
        steps.report(f"estimation of the final models of {group[0].size} terms", done)
        compared, count = group, _REFINED
        if steps.skip("estimation of further structures"):
            compared = _take_fittest(group, max(1, _SCREENED_SAMPLES // validation.samples))
            count = (1, 0)
        if settings.select == "fitness":
            count = count[::-1]
        kept = screen(compared, validation, settings.maximum_lag, *count)
        found += _estimate_models(kept, settings, split, offsets, steps)
    return found


def completed_parts(sizes: Sequence[int], samples: int) -> list[float]:
    """Return the completed part of the final estimation before each size, by the times that they take.

    Parameters
    ----------
    sizes : sequence of int
        Numbers of terms.
    samples : int
        Samples of the estimation data.
    """
    seconds = [1.0 + _SQUARE_SECONDS * samples * size**2 for size in sizes]
    return [sum(seconds[:place]) / sum(seconds) for place in range(len(seconds))]


def _evaluate_structures(hall_of_fame: HallOfFame, problem: Problem) -> tuple[Individual, ...]:
    structures = [*(require_genes(entry).genes for entry in hall_of_fame.entries), *problem.seeds]
    evaluated, _ = Evaluator(problem.record, problem.settings).evaluate(
        [(Individual(genes), False) for genes in structures]
    )
    return tuple(each for each in unique_structures(evaluated) if each.outcome)


def _group_by_size(items: Iterable[_Sized]) -> Collection[list[_Sized]]:
    groups: dict[int, list[_Sized]] = {}
    for item in items:
        groups.setdefault(item.size, []).append(item)
    return groups.values()


def screen(
    individuals: Sequence[Individual], validation: Dataset, warm_up: int, most_valid: int, fittest: int = 0
) -> list[Individual]:
    """Return the individuals with the least error on the validation data, and the fittest ones.

    Parameters
    ----------
    individuals : sequence of Individual
        Evaluated individuals with parameters.
    validation : Dataset
        Validation data in the units of the search.
    warm_up : int
        Number of samples before the first prediction.
    most_valid, fittest : int
        Number of individuals of each kind.
    """
    by_fitness = _take_fittest(individuals, len(individuals))
    by_error: list[tuple[float, Individual]] = []
    for each in by_fitness:
        # A simulation ends as soon as its error exceeds that of the last of the best ones so far.
        allowed = by_error[-1][0] if len(by_error) == most_valid else inf
        error = free_run_error(each.regressors, each.theta, validation, warm_up, allowed)
        if error < inf:
            by_error = sorted([*by_error, (error, each)], key=_order_by_error)[:most_valid]
    return list(unique_structures((*(each for _, each in by_error), *by_fitness[:fittest])))


def _order_by_error(entry: tuple[float, Individual]) -> tuple[float, tuple[str, ...], tuple[float, ...]]:
    error, individual = entry
    return error, individual.key, individual.theta


def _take_fittest(individuals: Sequence[Individual], most: int) -> list[Individual]:
    """Return the fittest individuals, the best one first."""
    return sorted(individuals, key=lambda each: (each.fitness, each.key))[:most]


def _estimate_models(
    individuals: list[Individual], settings: Settings, split: Split, offsets: Offsets, steps: Steps
) -> list[Candidate]:
    """Return models with estimated and with refined parameters in the units of the record.

    Models whose free run diverges are returned only if the fitness selects.
    """
    found = (
        estimate(
            add_offsets(each.regressors, offsets),
            split.estimation,
            settings.constraints,
            settings.maximum_lag,
            standard_errors=bool(settings.estimator),
        )
        for each in individuals
    )
    fitted = [
        each
        for each in found
        if not isinstance(each, EvaluationOutcome) and each.model.size <= settings.max_terms + any(offsets)
    ]
    keep = _choose_filter(settings)
    if settings.estimator:
        name = f"estimator {settings.estimator}"
        chosen = steps.attempt(name, partial(_estimate_with_choice, fitted, settings, split))
        if chosen is not None:
            return keep(chosen)
    estimated = [each.model for each in fitted]
    validated = keep(_validate(estimated, LEAST_SQUARES, split, settings.maximum_lag))
    if settings.refine:
        refine_all = partial(_refine_over_intervals, estimated, settings, split, steps)
        validated += keep(steps.attempt(_REFINEMENT, refine_all) or [])
    return validated


def _choose_filter(settings: Settings) -> Callable[[Iterable[Candidate]], list[Candidate]]:
    """Return which of the validated models are kept: all of them if the fitness selects."""
    return list[Candidate] if settings.select == "fitness" else _without_diverged


def _refine_over_intervals(
    models: Sequence[DynamicModel], settings: Settings, split: Split, steps: Steps
) -> list[Candidate]:
    """Refine models over the shooting interval of the fitness, and the best of them over others."""
    keep = _choose_filter(settings)
    interval = FITNESSES[settings.fitness](settings.shooting)
    refined = keep(_refine(models, interval, settings, split, steps))
    best = [each.model for each in refined[:_MOST_PROMISING]]
    lengths = [max(1, round(factor * interval)) for factor in _INTERVALS] if interval else []
    for length in lengths:
        refined += _refine(best, length, settings, split, steps)
    return refined


def _estimate_with_choice(fitted: list[FittedStructure], settings: Settings, split: Split) -> list[Candidate]:
    """Return models with the parameters of the estimator that the settings choose."""
    found = (
        estimate_with(
            settings.estimator,
            start,
            split.estimation,
            settings.constraints,
            settings.maximum_lag,
            settings.shooting,
        )
        for start in fitted
    )
    models = [each.model for each in found if not isinstance(each, EvaluationOutcome)]
    criterion = make_criterion(settings.estimator, settings.shooting)
    return _validate(models, criterion, split, settings.maximum_lag)


def _refine(
    models: Sequence[DynamicModel], interval: int | None, settings: Settings, split: Split, steps: Steps
) -> list[Candidate]:
    """Refine models over shooting intervals and validate them; the kernels run in parallel threads.

    The models race (successive halving: Karnin, Koren and Somekh 2013): after some steps, a model of the half
    with the larger error on all data is left as it is, unless its error still falls.
    """
    limits = settings.constraints, settings.maximum_lag
    stop = partial(steps.skip, _REFINEMENT)
    criterion = refinement_criterion(interval)

    def begin(model: DynamicModel) -> Refinement[DynamicModel] | None:
        begun = None if stop() else begin_refinement(model, split.estimation, interval, *limits)
        return None if isinstance(begun, EvaluationOutcome) else begun

    def validate(entry: Refinement[DynamicModel]) -> Candidate:
        (validated,) = _validate([entry.model], criterion, split, settings.maximum_lag)
        return validated

    left: list[Candidate] = []
    with ThreadPoolExecutor() as threads:
        racing = [each for each in threads.map(begin, models) if each is not None]
        if len(racing) > _FINALISTS:
            list(threads.map(lambda each: each.minimisation.advance(_RACE_STEPS, stop), racing))
            pairs = zip(threads.map(validate, racing), racing, strict=True)
            ranked = sorted(pairs, key=lambda pair: pair[0].order)
            most = max(_FINALISTS, len(ranked) // 2)
            ahead = [entry for _, entry in ranked[:most]]
            ahead += [entry for _, entry in ranked[most:] if entry.minimisation.gain > _GAINING]
            left = [candidate for candidate, entry in ranked if entry not in ahead]
            racing = ahead
        list(threads.map(lambda each: each.minimisation.advance(_MAX_STEPS, stop), racing))
        found = [*left, *threads.map(validate, racing)]
    return sorted(found, key=lambda entry: entry.order)


def _validate(
    models: Iterable[DynamicModel], criterion: Criterion, split: Split, warm_up: int
) -> list[Candidate]:
    """Simulate models on all data and return them, least error first."""
    validated = (ValidatedModel(model, criterion, measure_square(model, split, warm_up)) for model in models)
    return sorted(validated, key=lambda entry: entry.order)


def _without_diverged(
    validated: Iterable[Candidate],
) -> list[Candidate]:
    return [each for each in validated if isfinite(each.error)]
