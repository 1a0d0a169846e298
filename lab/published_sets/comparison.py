"""Rows of a benchmark: searches on the estimation data, their models on each test, published errors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from statistics import median

from islands.errors import IslandsError, SettingsError, check_integers, check_seconds, lookup
from islands.progress import (
    ProgressCallback,
    Stop,
    StoppedError,
    TimeLimit,
    ignore_progress,
    never_stop,
    prefix_messages,
    report_part,
)
from lab.published_sets.definition import CLASSES, LINEAR, METRIC, Benchmark, BenchmarkData, PublishedError
from lab.published_sets.model_searches import MODEL_SEARCHES, ModelSearch, count_terms
from lab.published_sets.scoring import measure_coverage, measure_rmse, separate_reason

#: Returns the time in seconds.
Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class ComparisonSettings:
    """What is compared.

    Attributes
    ----------
    classes : tuple of str
        Some of `CLASSES`.
    seeds : int
        Searches of a class whose result depends on the seed, from seed 0 on. Others are run once.
    budget : float or None
        Seconds after which a search is asked to stop; it ends with its best model so far.

    Raises
    ------
    SettingsError
        A class is unknown or given twice, or a number is not positive.
    """

    classes: tuple[str, ...] = CLASSES
    seeds: int = 1
    budget: float | None = None

    def __post_init__(self) -> None:
        for each in self.classes:
            lookup(MODEL_SEARCHES, each, "class of models")
        if not self.classes or len(set(self.classes)) < len(self.classes):
            raise SettingsError(f"give each class of models once, got {', '.join(self.classes) or 'none'}")
        check_integers(seeds=self.seeds)
        if self.seeds < 1:
            raise SettingsError(f"seeds is at least 1, got {self.seeds}")
        if self.budget is not None:
            check_seconds(self.budget, "the budget")

    @property
    def searches(self) -> list[tuple[str, int]]:
        """Class and seed of each search."""
        return [
            (each, seed)
            for each in self.classes
            for seed in range(self.seeds if MODEL_SEARCHES[each].is_random else 1)
        ]


@dataclass(frozen=True, slots=True)
class SeedOutcome:
    """Outcome of one search.

    Attributes
    ----------
    seed : int
    errors : mapping
        Error of each test in the unit of the benchmark, or the reason why there is none.
    terms, parameters : int or None
        None without a model.
    wall_s : float
    claimed : float or None
        Error on the validation data in this unit, with the parameters before an estimation on all data. None
        without validation data or without a model.
    coverage : mapping
        Fraction of the samples of each test inside of the band of 90 %, or None without a band. Tests without
        an error are absent.
    """

    seed: int
    errors: Mapping[str, float | str]
    terms: int | None
    parameters: int | None
    wall_s: float
    claimed: float | None = None
    coverage: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SeedError:
    """Error of one seed on one test; None with a reason if there is none.

    ``claimed`` and ``coverage`` are those of a `SeedOutcome`.
    """

    seed: int
    error: float | None
    reason: str | None
    claimed: float | None
    coverage: float | None


@dataclass(frozen=True, slots=True)
class BenchmarkRow:
    """Row of the table: one class of models on one test.

    Attributes
    ----------
    benchmark, test, metric, unit, model : str
    median, worst : float or None
        Over the seeds. A seed without an error counts as infinite, which is None.
    claimed : float or None
        Error on the validation data that the results state; median of the seeds with one.
    coverage : float or None
        Fraction of the samples of the test inside of the band of 90 %; median of the seeds with a band.
    per_seed : tuple of SeedError
    published : tuple of PublishedError
        The smallest first.
    linear : float or None
        Median of the linear models on this test; None if they were not searched or have no error.
    terms, parameters, wall_s : float or None
        Medians over the seeds with a model. Units are the terms of a state space.
    is_tuned : bool
        Whether the searches were developed with this set at hand.
    """

    benchmark: str
    test: str
    metric: str
    unit: str
    model: str
    median: float | None
    worst: float | None
    claimed: float | None
    coverage: float | None
    per_seed: tuple[SeedError, ...]
    published: tuple[PublishedError, ...]
    linear: float | None
    terms: float | None
    parameters: float | None
    wall_s: float
    is_tuned: bool


def compare(
    name: str,
    benchmark: Benchmark,
    data: BenchmarkData,
    settings: ComparisonSettings,
    clock: Clock,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
) -> list[BenchmarkRow]:
    """Search models of all classes on the estimation data, and measure them on all tests.

    Parameters
    ----------
    name : str
        Name of the benchmark.
    benchmark : Benchmark
    data : BenchmarkData
    settings : ComparisonSettings
    clock : callable
        Returns the time in seconds.
    progress : callable
    stop : callable
        Once it returns true, the comparison ends with the rows of the complete searches.

    Returns
    -------
    list of BenchmarkRow
        Test by test, in the order of the classes.
    """
    outcomes: dict[str, list[SeedOutcome]] = {}
    searches = settings.searches
    for place, (kind, seed) in enumerate(searches):
        part = report_part(progress, place / len(searches), (place + 1) / len(searches))
        report = prefix_messages(part, f"{name}, {kind}, seed {seed}: ")
        found = _search(benchmark, data, MODEL_SEARCHES[kind], seed, clock, settings.budget, report, stop)
        if stop():  # the search is not complete
            break
        outcomes.setdefault(kind, []).append(found)
    return make_rows(name, benchmark, list(data.tests), outcomes)


def _search(
    benchmark: Benchmark,
    data: BenchmarkData,
    search: ModelSearch,
    seed: int,
    clock: Clock,
    budget: float | None,
    progress: ProgressCallback,
    stop: Stop,
) -> SeedOutcome:
    """Search a model on the estimation data and measure it on all tests."""
    began = clock()
    limited = stop if budget is None else TimeLimit(began + budget, clock, stop)
    try:
        found = search.find(data.estimation, seed, progress, limited)
    except IslandsError as error:
        reason = str(error)
        if isinstance(error, StoppedError):
            reason = f"the budget ends before the first model, at: {error.step}"
        return SeedOutcome(seed, dict.fromkeys(data.tests, reason), None, None, clock() - began)
    wall_s, model = clock() - began, found.model
    errors: dict[str, float | str] = {}
    coverage: dict[str, float | None] = {}
    for name, test in data.tests.items():
        progress(f"test {name}", 1.0)
        try:
            errors[name] = benchmark.scale * measure_rmse(model, test)
            coverage[name] = measure_coverage(model, found.bands, test)
        except IslandsError as error:
            errors[name] = str(error)
    claimed = None if found.claimed is None else benchmark.scale * found.claimed
    return SeedOutcome(seed, errors, count_terms(model), len(model.parameters), wall_s, claimed, coverage)


def make_rows(
    name: str, benchmark: Benchmark, tests: Sequence[str], outcomes: Mapping[str, Sequence[SeedOutcome]]
) -> list[BenchmarkRow]:
    """Return the rows of a benchmark, test by test.

    Parameters
    ----------
    name : str
    benchmark : Benchmark
    tests : sequence of str
        Names of the tests.
    outcomes : mapping
        Outcomes of the seeds by class of models, at least one of each.
    """
    rows = []
    for test in tests:
        linear = _median(outcomes[LINEAR], test) if LINEAR in outcomes else None
        rows += [_make_row(name, benchmark, test, kind, found, linear) for kind, found in outcomes.items()]
    return rows


def _make_row(
    name: str,
    benchmark: Benchmark,
    test: str,
    kind: str,
    outcomes: Sequence[SeedOutcome],
    linear: float | None,
) -> BenchmarkRow:
    return BenchmarkRow(
        benchmark=name,
        test=test,
        metric=METRIC,
        unit=benchmark.unit,
        model=kind,
        median=_median(outcomes, test),
        worst=_finite(max(_as_number(each.errors[test]) for each in outcomes)),
        claimed=_median_known([each.claimed for each in outcomes]),
        coverage=_median_known([each.coverage.get(test) for each in outcomes]),
        per_seed=tuple(_describe_seed(each, test) for each in outcomes),
        published=benchmark.published.get(test, ()),
        linear=linear,
        terms=_median_known([each.terms for each in outcomes]),
        parameters=_median_known([each.parameters for each in outcomes]),
        wall_s=median(each.wall_s for each in outcomes),
        is_tuned=benchmark.is_tuned,
    )


def _median(outcomes: Sequence[SeedOutcome], test: str) -> float | None:
    return _finite(median(_as_number(each.errors[test]) for each in outcomes))


def _median_known(values: Sequence[float | None]) -> float | None:
    known = [each for each in values if each is not None]
    return median(known) if known else None


def _as_number(error: float | str) -> float:
    return inf if isinstance(error, str) else error


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _describe_seed(outcome: SeedOutcome, test: str) -> SeedError:
    value, reason = separate_reason(outcome.errors[test])
    return SeedError(outcome.seed, value, reason, outcome.claimed, outcome.coverage.get(test))
