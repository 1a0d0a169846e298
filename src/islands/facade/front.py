"""Front of a record: all models of the same data that compete, of every kind."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from islands.evolution.presets import AUTO
from islands.evolution.search_result import (
    BANDS,
    SearchResult,
    SearchStatistics,
    add_models,
    as_candidate,
    complete_search,
    list_simple_models,
    rank_models,
    state_steps,
    with_average,
)
from islands.facade.fit_settings import FitSettings
from islands.facade.library_fit import CERTIFICATES, LibraryFit, choose_shooting, describe_fit
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.prepared_data import PreparedData
from islands.progress import Steps, StoppedError
from islands.records.averaging import count_means
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.validation.assessment import Assessment

#: Estimators whose models compete with those of the free run: others state the noise.
_SIMULATING = "least-squares", "free-run"


@dataclass(frozen=True, slots=True)
class Front:
    """Models of a fit: those of one library, of further ones, and the simplest ones of the same data.

    Attributes
    ----------
    fit : LibraryFit
        Fit whose settings are those of the result.
    others : tuple of LibraryFit
        Fits of further libraries to the same data, under the same constraints.
    simple : tuple of Assessment
        Models that are no equation of a library: linear, and with one curve.
    """

    fit: LibraryFit
    others: tuple[LibraryFit, ...] = ()
    simple: tuple[Assessment, ...] = ()

    @property
    def found(self) -> SearchResult:
        """Result at the rate of the data, without certificates and prediction bands."""
        found = self.fit.found
        for models in (*(each.found.models for each in self.others), self.simple):
            found = add_models(found, models)
        return found

    @property
    def incomplete(self) -> SearchResult:
        """Result without certificates and prediction bands."""
        found = self.found
        return with_average(state_steps(found, self.fit.steps), found.average)

    def with_settings(self, **further: object) -> "Front":
        """Return the front with further settings in its result."""
        found = self.fit.found
        changed = replace(found, settings={**found.settings, **further})
        return replace(self, fit=replace(self.fit, found=changed))

    def complete(self) -> SearchResult:
        """Return the result with certificates and prediction bands."""
        settings, steps = self.fit.found.settings, self.fit.steps
        front = replace(self, fit=self.fit.certify())
        found = replace(front.found, settings=settings)
        fits = front.fit, *front.others
        estimates = [*(entry for each in fits for entry in each.estimates), *front.simple]
        return complete_search(found, list(map(as_candidate, estimates)), steps)


def list_simple(
    data: PreparedData, library: TrialLibrary, settings: FitSettings, steps: Steps
) -> list[Assessment]:
    """Return the simplest models of the data of a fit.

    A library that the user names has no models of another kind, besides the linear one.

    Parameters
    ----------
    data : PreparedData
    library : TrialLibrary
        Its lags give the number of samples before the first prediction, and its constraints hold.
    settings : FitSettings
    steps : Steps
        Each identification is an optional step.
    """
    if settings.selecting_estimator not in _SIMULATING:
        return []
    rated = library.at_rate(data.average)
    warm_up = rated.lags + max(rated.delays, default=0)
    interval = count_means(choose_shooting(settings, data), data.average)
    limits = interval, warm_up, library.constraints
    return list_simple_models(data.split, *limits, steps, curves=settings.library == AUTO)


class StoppedFitError(StoppedError):
    """A fit was stopped after its first model.

    Attributes
    ----------
    found : SearchResult
        Result of the models so far.
    """

    def __init__(self, step: str, found: SearchResult, left_out: Iterable[str]) -> None:
        super().__init__(step)
        missing = (*found.search.left_out, *left_out, CERTIFICATES, BANDS)
        search = replace(found.search, ended_by="stopped", left_out=missing)
        self.found = replace(found, search=search)


def find_linear_result(
    record: Dataset, split: Split, library: TrialLibrary, settings: FitSettings, seed: int, steps: Steps
) -> SearchResult | None:
    """Return the result of the linear model alone, the first model of a front.

    It takes a second, so that a stop from then on has a model. The fits of the same data do not identify it
    again.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user.
    split : Split
        Data at the rate of the record.
    library : TrialLibrary
        See `list_simple`.
    settings : FitSettings
    seed : int
    steps : Steps
        The identification is an optional step.
    """
    data = PreparedData(split)
    models = list_simple(data, library, replace(settings, library=library.name), steps)
    if not models:
        return None
    described = describe_fit(library, settings, choose_shooting(settings, data))
    search = SearchStatistics(len(models), {"ok": len(models)}, {"candidates": len(models), "bytes": 0})
    return with_average(SearchResult(record, split, seed, described, search, rank_models(models)), 1)
