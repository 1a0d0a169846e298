"""Result of a search: ranked models and statistics, of one output and of several."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any, TypeAlias, TypeVar

import numpy as np

from islands.errors import ModelError
from islands.estimation.quantity_errors import with_quantity_errors
from islands.estimation.structure_selection.certificate import Certificate
from islands.evolution.search_state import HistoryPoint
from islands.evolution.settings import ACCURATE, FITNESS_MODES
from islands.expressions.printing import plain_factor
from islands.models.equations import equation
from islands.models.form import is_linear, is_static
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.parallel import map_over_record
from islands.progress import Steps
from islands.records.averaging import count_means
from islands.records.channel_names import parse_channel_name
from islands.records.coupled import CoupledRecord, CoupledSplit
from islands.records.dataset import Dataset
from islands.records.loops import has_loops
from islands.records.split import Split
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.ensemble import Ensemble, ValidatedModel, make_ensemble
from islands.validation.prediction_bands import calibrate_bands
from islands.validation.recommendation import (
    Recommendation,
    is_sound,
    measure_squares,
    recommend,
    recommend_fittest,
)
from islands.validation.recommendation_reasons import state_fit, state_reasons
from islands.validation.simple_models import assess_curve_models, assess_linear_model

#: Result of the same search.
FoundT = TypeVar("FoundT", bound="SearchResult | CoupledSearchResult")

#: Name of the step that makes the ensemble and the prediction bands.
BANDS = "prediction bands"

#: Name of the step that estimates standard errors.
_ERRORS = "standard errors"

#: Name of the step that identifies the linear model of the same data.
LINEAR_MODEL = "linear model"

#: Name of the step that identifies linear models with one curve.
CURVE_MODELS = "linear models with one curve"


@dataclass(frozen=True, slots=True)
class SearchStatistics:
    """Statistics of a search.

    Attributes
    ----------
    evaluations : int
        Models estimated.
    outcomes : mapping
        Number of models by outcome: ``{"ok": 9, "singular": 1}``.
    full_set : mapping
        Size of the full polynomial set, equation (5), for the lags and degree searched: number of
        ``candidates``, and ``bytes`` that its regressor matrix would need.
    wall_s : float or None
        Duration in seconds; None if the search was not timed.
    generations : int or None
        Completed generations; None if the search is not an evolution.
    duplicates : int or None
        Individuals whose structure occurs among the parents or earlier in their generation; None if the
        search is not an evolution.
    feasible_share : float or None
        Fraction of individuals with estimated parameters; None if the search is not an evolution.
    history : tuple of HistoryPoint
        Best fitness by generation, oldest first; empty if the search is not an evolution.
    caches : mapping
        Bytes in use at the end of an evolution and byte limit of each cache, by name.
    ended_by : str or None
        Budget that an evolution used up, or ``stopped`` if a request ended the computation; None for a
        complete search that is not an evolution.
    left_out : tuple of str
        Steps that a request to stop has left out.
    not_computed : mapping
        Optional steps that failed, each with the reason.
    certificates : mapping
        Certificate of the candidate library by number of terms; empty if none was computed.
    """

    evaluations: int
    outcomes: Mapping[str, int]
    full_set: Mapping[str, int]
    wall_s: float | None = None
    generations: int | None = None
    duplicates: int | None = None
    feasible_share: float | None = None
    history: tuple[HistoryPoint, ...] = ()
    caches: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    ended_by: str | None = None
    left_out: tuple[str, ...] = ()
    not_computed: Mapping[str, str] = field(default_factory=dict)
    certificates: Mapping[int, Certificate] = field(default_factory=dict)

    @property
    def evaluations_per_second(self) -> float | None:
        """Evaluations per second; None if the search was not timed."""
        return self.evaluations / self.wall_s if self.wall_s else None


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """Complete result of a search.

    Attributes
    ----------
    record : Dataset
        Record as passed by the caller.
    split : Split
        Estimation data and validation data.
    seed : int
    settings : mapping
        Settings that determine the result, together with the record and the seed.
    search : SearchStatistics
    models : tuple of Assessment
        Models, least validation error first; see `rank_models`.
    ensemble : Ensemble or None
        Models that the data do not exclude. They give the inclusion probabilities of terms and the prediction
        bands. None if every free run diverged on the validation data.
    average : int
        Number of samples of the record whose mean is one sample of the estimation data and of the validation
        data.
    """

    record: Dataset
    split: Split
    seed: int
    settings: Mapping[str, Any]
    search: SearchStatistics
    models: tuple[Assessment, ...]
    ensemble: Ensemble | None = None
    average: int = 1

    @property
    def shooting_interval(self) -> int:
        """Samples of the data in each shooting interval; the setting counts samples of the record."""
        return count_means(int(self.settings["shooting"]), self.average)

    @property
    def direct_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that the models read at sample k (direct feedthrough)."""
        return list_direct_inputs(self.split.estimation.input_names)

    @property
    def requires_property_1(self) -> bool:
        """Whether the search constrains the parameters of models of hysteresis."""
        return "hysteresis" in self.settings["constraints"]

    @property
    def has_loop(self) -> bool:
        """Whether the output over the input is a loop, or models of hysteresis were searched for."""
        return self.requires_property_1 or has_loops(self.split.validation)

    @property
    def recommendation(self) -> Recommendation:
        """Rank of the recommended model, and the reasons."""
        hysteresis, unit = self.requires_property_1, self.record.output_unit
        if self.settings.get("select") == "fitness":  # a setting of evolution only
            mode = FITNESS_MODES[self.settings["fitness"]]
            found = recommend_fittest(self.models, mode)
            return replace(found, reasons=state_fit(self.models[found.rank - 1], mode, hysteresis, unit))
        accurate = self.settings.get("prefer") == ACCURATE
        found = recommend(self.models, hysteresis, accurate)
        return replace(found, reasons=state_reasons(found, self.models, hysteresis, unit, accurate))

    @property
    def recommended(self) -> Assessment:
        """Recommended model."""
        return self.models[self.recommendation.rank - 1]

    @property
    def linear(self) -> Assessment | None:
        """Best linear model on the validation data; None if the recommended model is linear.

        Models of hysteresis are not compared: those of the search that are linear have its constraints.
        """
        if self.requires_property_1 or is_linear(self.recommended.model):
            return None
        return next((entry for entry in self.models if is_linear(entry.model)), None)


def list_direct_inputs(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the inputs that are read at sample k, without the suffix ``+1``."""
    return tuple(channel.base for channel in map(parse_channel_name, names) if channel.at_once)


@dataclass(frozen=True, slots=True, eq=False)
class CoupledSearchResult:
    """Complete result of a search of several outputs; its attributes are those of a `SearchResult`.

    Attributes
    ----------
    record : CoupledRecord
        Record as passed by the caller.
    split : CoupledSplit
        Estimation data and validation data with the sampling time of the models.
    seed : int
    settings : mapping
        Settings that determine the result, together with the record and the seed.
    search : SearchStatistics
    models : tuple of CoupledAssessment
        Models, best first.
    outputs : tuple of SearchResult
        Separate result of every output; empty if one search has found the model of all of them.
    refusal : str
        Why the optional facts of the document are not computed; empty if they are.
    reasons : tuple of str
        Why the model is recommended; empty if it was compared with no other one.
    """

    record: CoupledRecord
    split: CoupledSplit
    seed: int
    settings: Mapping[str, Any]
    search: SearchStatistics
    models: tuple[CoupledAssessment, ...]
    outputs: tuple[SearchResult, ...] = ()
    refusal: str = ""
    reasons: tuple[str, ...] = ()

    @property
    def average(self) -> int:
        """Number of samples of the record whose mean is one sample of the models."""
        return self.models[0].model.average

    @property
    def shooting_interval(self) -> int:
        """Samples of the data in each shooting interval; the setting counts samples of the record."""
        return count_means(int(self.settings["shooting"]), self.average)

    @property
    def direct_inputs(self) -> tuple[str, ...]:
        """Names of the inputs that the models read at sample k."""
        return list_direct_inputs(self.split.estimation.input_names)

    @property
    def ensemble(self) -> Ensemble | None:
        """Models that the data do not exclude; None without bands, or if every output has its own."""
        bands = self.recommended.bands
        return None if bands is None else bands.ensemble

    @property
    def recommendation(self) -> Recommendation:
        """Rank of the recommended model: the first one."""
        return Recommendation(1, self.reasons, 1, ())

    @property
    def recommended(self) -> CoupledAssessment:
        """Recommended model."""
        return self.models[0]


#: Result of a search of one or several outputs.
AnySearchResult: TypeAlias = SearchResult | CoupledSearchResult


def require_one_output(found: AnySearchResult) -> SearchResult:
    """Return the result of a search of one output.

    Raises
    ------
    ModelError
        It is that of several outputs.
    """
    if isinstance(found, CoupledSearchResult):
        raise ModelError(
            "this is known of each output alone: take its separate result, one of `outputs` of the result"
        )
    return found


def sum_statistics(searches: Sequence[SearchStatistics], steps: Steps) -> SearchStatistics:
    """Return the statistics of all searches of several outputs, with the steps that their result lacks."""
    outcomes = Counter[str]()
    for search in searches:
        outcomes.update(search.outcomes)
    return SearchStatistics(
        sum(search.evaluations for search in searches),
        dict(outcomes),
        {},
        ended_by="stopped" if steps.left_out else searches[-1].ended_by,
        left_out=steps.left_out,
        not_computed=steps.not_computed,
    )


#: Receives a search result before its optional steps.
ResultCallback = Callable[[SearchResult], object]


def ignore_result(_found: SearchResult, /) -> None:
    """Ignore a result."""


def list_simple_models(
    split: Split, shooting: int, warm_up: int, constraints: str, steps: Steps, *, curves: bool = False
) -> list[Assessment]:
    """Return the linear model of the data of a search, which is one of its models; empty without one.

    Parameters
    ----------
    split, shooting, warm_up, constraints
        As for `assess_linear_model`.
    steps : Steps
        Each identification is an optional step.
    curves : bool
        Whether linear models with one curve follow.
    """
    parts = split, shooting, warm_up, constraints, steps
    steps.report(LINEAR_MODEL, None)
    linear = steps.attempt(LINEAR_MODEL, partial(assess_linear_model, *parts))
    found = [linear] if linear else []
    if curves:
        steps.report(CURVE_MODELS, None)
        found += steps.attempt(CURVE_MODELS, partial(assess_curve_models, *parts)) or []
    return found


def add_models(found: SearchResult, models: Sequence[Assessment]) -> SearchResult:
    """Return a search result with further models of the same data; see `keep_best_of_sizes`."""
    return replace(found, models=keep_best_of_sizes([*found.models, *models]))


def as_candidate(entry: Assessment) -> ValidatedModel[DynamicModel]:
    """Return an assessed model that was estimated as a candidate of an ensemble."""
    assert entry.criterion is not None, "the models of a search are estimated"
    return ValidatedModel(entry.model, entry.criterion, entry.mean_square, entry.all_data)


def complete_search(
    found: SearchResult, candidates: Sequence[ValidatedModel[DynamicModel]], steps: Steps
) -> SearchResult:
    """Return a search result with standard errors of its quantities and calibrated prediction bands.

    Without them once a stop is requested, or if they fail. The result states the steps that it lacks, and its
    models the number of samples of a mean.

    Parameters
    ----------
    found : SearchResult
        At the rate of its data.
    candidates : sequence of ValidatedModel
        All models that were estimated; they give the ensemble.
    steps : Steps
    """
    constraints, data = str(found.settings["constraints"]), found.split.estimation
    add = partial(_add_errors, record=data, constraints=constraints)
    models = steps.attempt(_ERRORS, lambda: tuple(map_over_record(add, found.models, data.samples)))
    found = found if models is None else replace(found, models=models)
    steps.report(BANDS, 1.0)
    skip = partial(steps.skip, BANDS)

    def compute() -> SearchResult:
        recommended = found.recommended.model
        warm_up = max(entry.warm_up for entry in found.models)
        ensemble = make_ensemble(candidates, found.split, constraints, warm_up, found.seed, skip, recommended)
        if skip() or ensemble is None:
            return found
        calibrated = calibrate_bands([entry.model for entry in found.models], ensemble, found.split, warm_up)
        models = zip(found.models, calibrated, strict=True)
        banded = tuple(replace(entry, bands=bands) for entry, bands in models)
        return replace(found, models=banded, ensemble=ensemble)

    return with_average(state_steps(steps.attempt(BANDS, compute) or found, steps), found.average)


def _add_errors(entry: Assessment, record: Dataset, constraints: str) -> Assessment:
    model = entry.model
    if not isinstance(model, LatentModel) or model.quantity_errors is not None:
        return entry
    return replace(entry, model=with_quantity_errors(model, record, entry.warm_up, constraints))


def state_steps(found: FoundT, steps: Steps) -> FoundT:
    """Return a search result with the steps that were left out, and those that failed."""
    search = found.search
    if steps.left_out:
        search = replace(search, ended_by="stopped", left_out=steps.left_out)
    if steps.not_computed:
        search = replace(search, not_computed={**search.not_computed, **steps.not_computed})
    return found if search is found.search else replace(found, search=search)


def without_optional_steps(found: SearchResult, reason: str) -> SearchResult:
    """Return a search result whose models are not checked, to be stored before the steps after the search.

    Parameters
    ----------
    found : SearchResult
    reason : str
        Why the other steps have no values yet.
    """
    models = tuple(replace(entry, checks=entry.checks.without(reason)) for entry in found.models)
    search = replace(found.search, not_computed={**found.search.not_computed, BANDS: reason})
    return replace(found, search=search, models=models)


def with_average(found: SearchResult, average: int) -> SearchResult:
    """Return a search result on means of samples; its models state the number of samples of a mean."""
    models = tuple(_average(entry, average) for entry in found.models)
    return replace(found, models=models, average=average)


def _average(entry: Assessment, average: int) -> Assessment:
    return replace(entry, model=replace(entry.model, average=average))


def rank_models(models: Sequence[Assessment]) -> tuple[Assessment, ...]:
    """Sort models by the RMSE of their free run on the validation data, best first.

    Models whose free run diverged come last, sorted by one-step-ahead RMSE; an infinite one comes at the end.
    Ties are broken by size, then by the text of the equation. The validation data select the model, so the
    validation error is not an unbiased test error.
    """
    return tuple(sorted(models, key=_ranking_key))


def take_recommended(models: Sequence[Assessment]) -> Assessment:
    """Return the recommended one of some models of the same data, at least one; see `recommend`."""
    ranked = rank_models(models)
    return ranked[recommend(ranked, False).rank - 1]


def keep_best_of_sizes(models: Sequence[Assessment]) -> tuple[Assessment, ...]:
    """Return the models with the most evidence of every class and size, best first; see `rank_models`.

    Of one size, the least whitened error of the free run on all data is the most evidence. If the best model
    fails the physics checks, the best one of those that pass them is kept as well, as in a recommendation.
    """
    ranked = rank_models(models)
    squares, _ = measure_squares(ranked) if ranked else ([], 0)
    groups: dict[tuple[str, bool, bool, int], list[Assessment]] = {}
    for _, entry in sorted(zip(squares, ranked, strict=True), key=lambda pair: pair[0]):
        model = entry.model
        kind = model.kind, is_linear(model) and isinstance(model, LatentModel), is_static(model)
        groups.setdefault((*kind, entry.model.free_size), []).append(entry)
    kept = []
    for group in groups.values():
        kept.append(group[0])
        if not is_sound(group[0].physics, hysteresis=False):
            kept += [each for each in group if is_sound(each.physics, hysteresis=False)][:1]
    return rank_models(kept)


def _ranking_key(entry: Assessment) -> tuple[bool, float, int, str]:
    errors = entry.metrics["validation"]
    diverged = bool(np.isnan(errors["free_run"].rmse))
    rmse = errors["one_step_ahead" if diverged else "free_run"].rmse
    model = entry.model
    text = equation(model, 17, plain_factor) if isinstance(model, Model) else model.equation().line
    return diverged, inf if np.isnan(rmse) else rmse, entry.model.size, text
