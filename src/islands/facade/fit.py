"""Subset selection over a candidate library, (constrained) least squares, assessment."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from islands.data.averaging import AUTO, count_means
from islands.data.dataset import Dataset
from islands.data.split import Split, split_data
from islands.errors import SettingsError, lookup
from islands.estimation.estimator_table import ESTIMATORS
from islands.estimation.estimators import estimate_with
from islands.estimation.forward_selection import (
    Structure,
    make_selection_problem,
    select_forward,
    select_pool,
)
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.certificate import Certificate, certify, combine_certificates
from islands.estimation.structure_selection.deviations import (
    LARGE_OFFSET,
    OPERATING_POINT,
    Offsets,
    estimate_deviations,
    find_offsets,
    no_offsets,
    subtract_offsets,
)
from islands.estimation.structure_selection.input_ranking import screen_candidates
from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.generation.swap_search import swap_search
from islands.evolution.progress import ProgressCallback, ignore_progress
from islands.evolution.search_result import (
    RankedModel,
    SearchResult,
    SearchStatistics,
    rank_models,
    with_average,
    with_bands,
)
from islands.evolution.settings import Settings
from islands.facade.automatic.kind_choice import choose_library
from islands.facade.feedthrough_selection import select_feedthrough
from islands.facade.final_models import screen
from islands.facade.rate_selection import select_rate
from islands.facade.results.result import Result
from islands.io.data_frames import read_data
from islands.io.result_folder import record_document
from islands.model.candidate_library import full_set
from islands.model.regressor import Regressor
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.assessment import assess
from islands.validation.ensemble import ValidatedModel

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.io.data_frames import RecordLike

#: Samples of a shooting interval (case 1 of the paper); at most a tenth of a short record.
SHOOTING = 500

#: Structures of every size that are simulated on the validation data.
_SCREENED = 150


def fit(
    record: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    validation: "RecordLike | float" = 0.25,
    library: str = AUTO,
    degree: int | None = None,
    lags: int | None = None,
    delays: Sequence[int] | None = None,
    max_terms: int = 10,
    constraints: str | None = None,
    estimator: str = "least-squares",
    average: int | str = AUTO,
    feedthrough: str = AUTO,
    shooting: int | None = None,
    certificate: int = 10_000,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
) -> Result:
    """Fit models of increasing size to a record by subset selection and rank them on validation data.

    Parameters
    ----------
    record : Dataset, data frame or array
        Data without missing values, as `as_record` takes them: a `Dataset`; a frame of pandas or polars or an
        xarray Dataset, with ``inputs`` and ``output``; or the inputs as an array, followed by ``y`` and
        ``dt``.
    y : array, optional
        The output, of shape (samples,), if ``record`` is an array.
    dt : float, optional
        Sampling time in seconds. A frame with a time, as its index or as a column, does not need it.
    inputs, output
        Names of the columns of a frame.
    validation : Dataset, data frame or float
        Data that rank the models: a separate record, or the fraction at the end of ``record``.
    library : str
        An entry of ``LIBRARIES``, such as ``phi-polynomial`` for hysteresis or ``polynomial`` for smooth
        systems. ``auto`` chooses the library by trials on the estimation data, as the preset ``auto`` does.
    degree, lags : int, optional
        Degree and lags of the library; None takes the defaults of the library.
    delays : sequence of int, optional
        Dead times by which the library reads the inputs later, in samples of the record: one, or one for each
        input. None estimates them with the library ``auto``, and is none with others.
    max_terms : int
        Size of the largest model.
    constraints : str, optional
        ``hysteresis``, ``none`` or statements such as ``odd; gain = 2.5``; None takes the default of the
        library.
    estimator : str
        An entry of ``ESTIMATORS``, which estimates the parameters of the selected structures.
    average : int or str
        Samples of a mean that becomes one sample of the data, 1 for none. ``auto`` averages the noise of an
        oversampled record if small models are clearly better on the validation data. Models then have the
        sampling time of the means.
    feedthrough : str
        Whether models read inputs at sample k: ``yes`` for all inputs, ``no``, or ``auto`` for those to which
        the output of the estimation data responds within the sample.
    shooting : int, optional
        Samples of the record, before averaging, in each interval of multiple shooting.
    certificate : int
        Nodes of the search for the best structure of each size, and for the bound on the one-step-ahead error
        of all others; 0 for forward selection only.
    seed : int
        Stored in the result; forward selection is deterministic.
    progress : callable, optional
        Called with a message and the completed fraction.

    Returns
    -------
    Result
        Models of every size, least validation error first. ``result.best`` is the recommended one.

    Raises
    ------
    SettingsError
        A setting is unknown or out of range, or no model could be estimated.
    RecordError
        The record is too short or incomplete, or the validation data has other columns or sampling time.
    """
    record, validation = read_data(record, y, dt, inputs, output, validation)
    lookup(ESTIMATORS, estimator, "estimator")
    if max_terms < 1:
        raise SettingsError(f"a model has at least one term, got max_terms = {max_terms}")
    if certificate < 0:
        raise SettingsError(f"a search has at least 0 nodes, got certificate = {certificate}")
    whole = split_data(record, validation)
    shooting = min(SHOOTING, max(1, whole.estimation.samples // 10)) if shooting is None else shooting
    if shooting < 1:
        raise SettingsError(f"a shooting interval has at least 1 sample, got {shooting}")
    choice, trial = choose_library(whole.estimation, library, degree, lags, constraints, delays, progress)
    constraints = trial.constraints
    progress("sampling rate and direct feedthrough", 0.0)
    parts, samples = select_rate(whole, average, trial, trial.lags + 3 + max(trial.delays, default=0))
    rated = trial.at_rate(samples)
    parts = select_feedthrough(parts, feedthrough, rated)
    interval = count_means(shooting, samples)

    settings = Settings(
        library=trial.name,
        library_degree=trial.degree,
        library_lags=trial.lags,
        library_delays=rated.delays,
        shifts=(),
        max_terms=max_terms,
        initial_terms=(1, max_terms),
        constraints=constraints,
        shooting=interval,
    )
    structures, certificates, warm_up = _select(parts, settings, certificate, progress)
    outcomes: Counter[str] = Counter()
    models = []
    for done, (structure, offsets) in enumerate(structures, start=1):
        estimated = estimate_deviations(structure, offsets, parts.estimation, constraints, warm_up)
        if not isinstance(estimated, EvaluationOutcome):
            estimated = estimate_with(estimator, estimated, parts.estimation, constraints, warm_up, interval)
        if isinstance(estimated, EvaluationOutcome):
            outcomes[estimated.verdict.name.lower()] += 1
            continue
        if estimated.model.size > max_terms:
            continue
        outcomes["ok"] += 1
        assessment = assess(estimated.model, parts, interval, warm_up, constraints)
        models.append(RankedModel(estimated.model, assessment))
        progress(f"model of {estimated.model.size} terms", done / len(structures))
    if not models:
        raise SettingsError(
            f"no model could be estimated: {dict(outcomes)}; take another library or a longer record"
        )
    best_of_size: dict[int, RankedModel] = {}
    for ranked in rank_models(models):
        best_of_size.setdefault(ranked.model.size, ranked)
    rows = sum(max(0, length - warm_up) for length in parts.estimation.segments)
    count = full_set(trial.degree, trial.lags, trial.lags, record.inputs)
    search = SearchStatistics(
        sum(outcomes.values()),
        dict(outcomes),
        {"candidates": count, "bytes": 8 * count * rows},
        certificates={found.terms: found for found in certificates},
    )
    described = {
        "method": "fit",
        "library": trial.name,
        "degree": trial.degree,
        "lags": trial.lags,
        "delays": trial.delays,
        "max_terms": max_terms,
        "constraints": constraints,
        "estimator": estimator,
        "average": average,
        "feedthrough": feedthrough,
        "shooting": shooting,
        "certificate": certificate,
        "validation": record_document(validation) if isinstance(validation, Dataset) else validation,
    }
    described |= {} if choice is None else {"choice": choice.to_document()}
    result = SearchResult(record, parts, seed, described, search, tuple(best_of_size.values()))
    minimised = ESTIMATORS[estimator].interval(interval)
    estimates = [
        ValidatedModel(entry.model, minimised, entry.assessment.metrics["validation"]["free_run"].rmse ** 2)
        for entry in models
    ]
    return Result(with_average(with_bands(result, estimates, constraints, warm_up), samples))


def _select(
    split: Split, settings: Settings, nodes: int, progress: ProgressCallback
) -> tuple[list[tuple[Structure, Offsets]], tuple[Certificate, ...], int]:
    """Return structures, each with the offsets of its signals, the certificates, and the largest lag."""
    # A law in the units of the record has fewer terms there, a law around an operating point has fewer terms
    # in deviations from it. The validation data tell which one holds.
    record, constraints = split.estimation, settings.constraints
    tried = [no_offsets(record)]
    if constraint(constraints).allows_offsets:
        tried = [find_offsets(record, limit) for limit in (LARGE_OFFSET, OPERATING_POINT)]
    structures: list[tuple[Structure, Offsets]] = []
    certificates: tuple[Certificate, ...] | None = None
    warm_up = 0
    for offsets in dict.fromkeys(tried):
        deviations = Split(*(subtract_offsets(part, offsets) for part in (record, split.validation)))
        pool = screen_candidates(
            settings.library,
            settings.library_degree,
            settings.library_lags,
            deviations.estimation,
            constraints,
            settings.library_delays,
        )
        warm_up = max(item.maximum_lag for item in pool)
        progress(f"inner products of {len(pool)} candidates", 0.0)
        problem = make_selection_problem(pool, deviations.estimation, constraints)
        if isinstance(problem, EvaluationOutcome):
            raise SettingsError(f"nothing can be fitted with these settings: {problem}")
        progress(f"best subsets of {len(pool)} candidates", 0.0)
        found = certify(problem, settings.max_terms, nodes)
        certificates = combine_certificates(certificates, found)
        starts = [*select_forward(problem, settings.max_terms), *(entry.structure for entry in found)]
        exchanged = select_pool(pool, problem, settings.max_terms)
        chosen = [*starts, *_search_swaps(exchanged, starts, deviations, settings, progress)]
        structures += [(structure, offsets) for structure in chosen]
    return list(dict.fromkeys(structures)), certificates or (), warm_up


def _search_swaps(
    pool: Sequence[Regressor],
    starts: Sequence[Structure],
    split: Split,
    settings: Settings,
    progress: ProgressCallback,
) -> list[Structure]:
    """Return, for every size, the structure of a swap search with the least error on the validation data."""
    by_size = swap_search(
        Evaluator(split.estimation, settings),
        [item.expression for item in pool],
        [tuple(item.expression for item in structure) for structure in starts],
        depth=_SCREENED,
        progress=progress,
    )
    return [
        each.regressors
        for individuals in by_size
        for each in screen(individuals, split.validation, settings.maximum_lag, most_valid=1)
    ]
