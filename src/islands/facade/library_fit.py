"""Subset selection over one candidate library, (constrained) least squares, assessment."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial, reduce
from typing import Any

from islands.available_cpus import count_cpus
from islands.errors import SettingsError
from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import make_criterion
from islands.estimation.estimators import estimate_with
from islands.estimation.forward_selection import (
    Structure,
    find_simplest,
    make_selection_problem,
    select_forward,
    select_pool,
)
from islands.estimation.structure_selection.certificate import (
    Certificate,
    SubsetSearch,
    combine_certificates,
)
from islands.estimation.structure_selection.deviations import (
    LARGE_OFFSET,
    Offsets,
    add_offsets,
    find_offsets,
    subtract_offsets,
)
from islands.evolution.evaluation import Evaluator
from islands.evolution.individual import Individual, Population
from islands.evolution.search_result import (
    SearchResult,
    SearchStatistics,
    keep_best_of_sizes,
)
from islands.evolution.settings import Settings
from islands.evolution.swap_search import swap_search
from islands.facade.final_models import screen
from islands.facade.fit_settings import FitSettings
from islands.facade.free_run_refinement import REFINEMENT, refine_models
from islands.facade.results.model_simulation import SHOOTING
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.prepared_data import PreparedData
from islands.models.candidate_library import full_set
from islands.models.narx import Model, canonical_order
from islands.models.protocol import DynamicModel
from islands.models.regressor import Regressor
from islands.parallel import map_over_record
from islands.progress import Steps, StoppedError
from islands.records.averaging import count_means
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import Assessment, assess

#: Structures of every size that are simulated on the validation data.
_SCREENED = 150

#: Name of the step that computes bounds on the error of all models.
CERTIFICATES = "bounds of the errors of all models"

#: Name of the step that fits a library again.
_REFIT = "fit of better subsets"

#: Settings of models of other classes.
_OF_CLASSES = ("model", "structure")

#: A structure for every number of terms.
Subsets = tuple[Structure, ...]


@dataclass(frozen=True, slots=True)
class LibraryFit:
    """Equations of increasing size from one library.

    Attributes
    ----------
    found : SearchResult
        At the rate of the data, without certificates and prediction bands.
    estimates : list of Assessment
        All equations that were estimated.
    warm_up : int
        Number of samples before the first prediction.
    searches : tuple of SubsetSearch
        Searches for subsets of the library, one for the signals as recorded and one for their deviations.
    subsets : tuple of tuple of Structure
        Subsets of each search from which the fit started.
    refit : callable
        Fits the library again, with other subsets in place of those of the searches.
    steps : Steps
    """

    found: SearchResult
    estimates: list[Assessment]
    warm_up: int
    searches: tuple[SubsetSearch, ...]
    subsets: tuple[Subsets, ...]
    refit: Callable[[Steps, Sequence[Subsets]], "LibraryFit"]
    steps: Steps

    def contains(self, model: DynamicModel, library: TrialLibrary) -> bool:
        """Return whether a library, at the rate of the record, has all terms of a model."""
        record = self.found.split.estimation
        pool = library.at_rate(self.found.average).screen(record)
        return isinstance(model, Model) and any(
            set(model.regressors).issubset(add_offsets(pool, offsets))
            for offsets in _list_offsets(record, library.constraints)
        )

    def certify(self) -> "LibraryFit":
        """Return the fit with the certificates of its library.

        The searches for the certificates seldom find a better subset than the exchanges of the fit: in 3 of
        890 searches on 36 records. The library is then fitted again from these subsets.
        """
        tables = self.steps.attempt(CERTIFICATES, self._certify) or []
        subsets = [tuple(each.structure for each in table) for table in tables]
        known = [each[: len(some)] for each, some in zip(self.subsets, subsets, strict=False)]
        again = None if subsets == known else self.steps.attempt(_REFIT, partial(self._fit_again, subsets))
        fit = again or self
        certificates = {each.terms: each for each in (reduce(combine_certificates, tables) if tables else ())}
        search = replace(fit.found.search, certificates=certificates)
        return replace(fit, found=replace(fit.found, search=search), steps=self.steps)

    def _certify(self) -> list[tuple[Certificate, ...]]:
        """Return the certificates of every search."""
        skip = partial(self.steps.skip, CERTIFICATES)
        return [each.certify(self.found.settings["certificate"], skip) for each in self.searches]

    def _fit_again(self, subsets: Sequence[Subsets]) -> "LibraryFit":
        """Return the fit of other subsets, unless a stop is requested before its end."""
        steps = Steps(
            lambda text, _=None: self.steps.report(text, None), self.steps.stop
        )  # no fraction falls
        fit = self.refit(steps, subsets)
        if steps.left_out:
            raise StoppedError(_REFIT)
        return fit


def choose_shooting(settings: FitSettings, data: PreparedData) -> int:
    """Return the length of a multiple-shooting interval in samples of the record.

    By default, it is at most a tenth of a short record.
    """
    samples = data.split.estimation.samples * data.average
    return settings.shooting or min(SHOOTING, max(1, samples // 10))


def describe_fit(library: TrialLibrary, settings: FitSettings, shooting: int) -> dict[str, Any]:
    """Return the settings of the result of a fit of a library, as JSON values.

    Parameters
    ----------
    library : TrialLibrary
    settings : FitSettings
    shooting : int
        See `choose_shooting`.
    """
    return {
        "method": "fit",
        **{name: value for name, value in asdict(settings).items() if name not in _OF_CLASSES},
        "library": library.name,
        "degree": library.degree,
        "lags": library.lags,
        "delays": library.delays,
        "constraints": library.constraints,
        "shooting": shooting,
    }


def fit_library(
    record: Dataset,
    data: PreparedData,
    library: TrialLibrary,
    settings: FitSettings,
    seed: int,
    steps: Steps,
    subsets: Sequence[Subsets] = (),
) -> LibraryFit:
    """Fit equations of increasing size from one library and rank them on the validation data.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user, which the result contains.
    data : PreparedData
    library : TrialLibrary
        With dead times in samples of the record.
    settings : FitSettings
    seed : int
        Stored in the result.
    steps : Steps
        Once a stop is requested and structures are known, the best one of every size is estimated, and the
        other steps are left out.
    subsets : sequence of tuple of Structure
        Subsets for every search; by default those that exchanges find.

    Raises
    ------
    StoppedError
        A stop was requested before a structure was known.
    SettingsError
        No model could be estimated.
    RecordError
        The record is too short.
    """
    split = data.split
    shooting = choose_shooting(settings, data)
    rated, interval = library.at_rate(data.average), count_means(shooting, data.average)
    swaps = rated.make_settings(settings.max_terms, interval)
    exchange = bool(settings.certificate)
    structures, searches, started, warm_up = _select(split, rated, swaps, exchange, subsets, steps)
    models, outcomes = _estimate(structures, split, settings, swaps, warm_up, steps)
    rows = sum(max(0, length - warm_up) for length in split.estimation.segments)
    count = full_set(library.degree, library.lags, library.lags, record.inputs)
    search = SearchStatistics(
        sum(outcomes.values()),
        dict(outcomes),
        {"candidates": count, "bytes": 8 * count * rows},
    )
    described = describe_fit(library, settings, shooting)
    best = keep_best_of_sizes(models)
    result = SearchResult(record, split, seed, described, search, best, average=data.average)
    if not settings.estimator:
        refine_all = partial(refine_models, result, warm_up, steps)
        result, refined = steps.attempt(REFINEMENT, refine_all) or (result, [])
        models += refined

    refit = partial(fit_library, record, data, library, settings, seed)
    return LibraryFit(result, models, warm_up, searches, started, refit, steps)


def _estimate(
    structures: Sequence[tuple[Structure, Offsets]],
    split: Split,
    settings: FitSettings,
    swaps: Settings,
    warm_up: int,
    steps: Steps,
) -> tuple[list[Assessment], Counter[str]]:
    """Estimate and assess a model of every structure; return the models and the number of each outcome.

    Once a stop is requested, only the last structure of every size that has no model is estimated.
    """
    constraints, interval = swaps.constraints, swaps.shooting
    criterion = make_criterion(settings.selecting_estimator, interval)
    found: list[Assessment | EvaluationOutcome | None] = [None] * len(structures)
    by_size: dict[int, list[int]] = {}
    for place, (structure, _) in enumerate(structures):
        by_size.setdefault(len(structure), []).append(place)

    def estimate_size(size: int) -> None:
        for place in by_size[size]:
            is_needed = place == by_size[size][-1] and not any(
                isinstance(found[each], Assessment) for each in by_size[size]
            )
            if not is_needed and steps.skip("estimation of further structures"):
                continue
            structure, offsets = structures[place]
            estimated = estimate(add_offsets(structure, offsets), split.estimation, constraints, warm_up)
            if not isinstance(estimated, EvaluationOutcome):
                estimated = estimate_with(
                    settings.selecting_estimator, estimated, split.estimation, constraints, warm_up, interval
                )
            if isinstance(estimated, EvaluationOutcome):
                found[place] = estimated
            # The constant that an offset requires belongs to the unit, not to the law.
            elif estimated.model.size <= settings.max_terms + any(offsets):
                found[place] = assess(estimated.model, split, interval, warm_up, constraints, criterion)

    sizes = map_over_record(estimate_size, by_size, split.estimation.samples)
    for done, size in enumerate(by_size):
        steps.report(f"estimation of {size} terms", done / len(by_size))
        next(sizes)
    models = [each for each in found if isinstance(each, Assessment)]
    outcomes = Counter(
        "ok" if isinstance(each, Assessment) else each.verdict.name.lower()
        for each in found
        if each is not None
    )
    if not models:
        raise SettingsError(
            f"no model could be estimated: {_describe_outcomes(outcomes)}; take another library or a longer "
            "record"
        )
    return models, outcomes


def _describe_outcomes(outcomes: Mapping[str, int]) -> str:
    """Return why no structure has a model: ``singular (2 structures)``."""
    if not outcomes:
        return "no term of the library reduces the error on the estimation data"
    return ", ".join(
        f"{name.replace('_', ' ')} ({count} structure{'s' if count > 1 else ''})"
        for name, count in outcomes.items()
    )


def _select(
    split: Split,
    library: TrialLibrary,
    settings: Settings,
    exchange: bool,
    subsets: Sequence[Subsets],
    steps: Steps,
) -> tuple[list[tuple[Structure, Offsets]], tuple[SubsetSearch, ...], tuple[Subsets, ...], int]:
    """Return structures with the offsets of their signals, searches, their subsets, and the largest lag."""
    record, constraints = split.estimation, settings.constraints
    structures: list[tuple[Structure, Offsets]] = []
    searches: list[SubsetSearch] = []
    started: list[Subsets] = []
    warm_up = 0
    for offsets in _list_offsets(record, constraints):
        deviations = Split(*(subtract_offsets(part, offsets) for part in (record, split.validation)))
        pool = library.screen(deviations.estimation)
        warm_up = max(item.maximum_lag for item in pool)
        if structures and steps.skip("structures in deviations from the operating point"):
            break
        steps(f"inner products of {len(pool)} candidates", 0.0)
        problem = make_selection_problem(pool, deviations.estimation, constraints)
        if isinstance(problem, EvaluationOutcome):
            raise SettingsError(f"nothing can be fitted with these settings: {problem}")
        starts = list(select_forward(problem, settings.max_terms))
        steps.report(f"best subsets of {len(pool)} candidates", 0.0)
        if exchange:
            searches.append(SubsetSearch(problem, settings.max_terms))
            is_given = len(searches) <= len(subsets)
            started.append(subsets[len(searches) - 1] if is_given else searches[-1].structures)
            starts += started[-1]
        exchanged = select_pool(pool, problem, settings.max_terms)
        chosen = [*starts, *_search_swaps(exchanged, starts, deviations, settings, steps)]
        simplest = find_simplest(problem)
        structures += [
            (tuple(canonical_order(simplest.get(item, item) for item in structure)), offsets)
            for structure in chosen
        ]
    return list(dict.fromkeys(structures)), tuple(searches), tuple(started), warm_up


def _list_offsets(record: Dataset, constraints: str) -> Sequence[Offsets]:
    """Return the offsets with which structures are selected.

    A law in the units of the record has fewer terms there, a law around an operating point has fewer terms in
    deviations from it. The validation data tell which one holds.
    """
    found = (find_offsets(record, constraints, limit) for limit in (LARGE_OFFSET, 0.0))
    return list(dict.fromkeys(found))


def _search_swaps(
    pool: Sequence[Regressor],
    starts: Sequence[Structure],
    split: Split,
    settings: Settings,
    steps: Steps,
) -> list[Structure]:
    """Return, for every size, the structure of a swap search with the least error on the validation data."""
    by_size = swap_search(
        Evaluator(split.estimation, settings, threads=count_cpus()),
        [item.expression for item in pool],
        [tuple(item.expression for item in structure) for structure in starts],
        depth=_SCREENED,
        steps=steps,
    )

    def choose(individuals: Population) -> Sequence[Individual]:
        if steps.skip("choice of the structures on the validation data"):
            return individuals[:1]
        return screen(individuals, split.validation, settings.maximum_lag, most_valid=1)

    chosen = map_over_record(choose, by_size, split.validation.samples)
    return [each.regressors for individuals in chosen for each in individuals]
