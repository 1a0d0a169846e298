"""Identification by evolution (MGGP/FROE), refinement and validation."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from islands.errors import RecordError, SettingsError, check_seed
from islands.estimation.structure_selection.deviations import (
    LARGE_OFFSET,
    SHIFTABLE,
    Offsets,
    find_offsets,
    no_offsets,
    subtract_offsets,
)
from islands.evolution.engine import Engine
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import require_genes
from islands.evolution.presets import AUTO, resolve_kind, resolve_settings, with_tuples
from islands.evolution.problem import Problem, make_problem
from islands.evolution.search_result import (
    ResultCallback,
    SearchResult,
    SearchStatistics,
    as_candidate,
    ignore_result,
    list_simple_models,
    rank_models,
    with_average,
    with_bands,
)
from islands.evolution.search_state import SearchState, stop_reason
from islands.evolution.settings import LATENT, Settings
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.expressions.user_primitive import get_source
from islands.facade.automatic.kind_choice import Choice, StoppedChoiceError
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.coupled.identification import identify_outputs
from islands.facade.engine_choice import Ray, open_engine
from islands.facade.evolution_run import SearchCallback, begin_search, evolve, ignore_epoch
from islands.facade.final_models import estimate_candidates, select_final_models
from islands.facade.latent_identification import complete_latent, search_latent
from islands.facade.refit import refit_models
from islands.facade.results.identification import Result
from islands.facade.trials.feedthrough_selection import select_feedthrough
from islands.facade.trials.library import make_trial_library
from islands.facade.trials.rate_selection import select_rate
from islands.models.candidate_library import full_set
from islands.program.primitive_functions import row_address
from islands.progress import (
    ProgressCallback,
    Steps,
    Stop,
    StoppedError,
    ignore_progress,
    never_stop,
)
from islands.records.averaging import count_means
from islands.records.coupled import AnyRecord, CoupledRecord, split_coupled, split_first
from islands.records.dataset import Dataset
from islands.records.reading.data_frames import read_data
from islands.records.reading.options import DEFAULT_READING
from islands.records.split import Split, split_data, warn_of_extrapolation
from islands.report.documents.result_folder import record_document
from islands.settings_schema import document_settings
from islands.validation.assessment import Assessment

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.records.reading.data_frames import ReadingLike, RecordLike

#: Outcomes of individuals with estimated parameters.
FEASIBLE_OUTCOMES = ("ok", "abandoned")

#: Smallest number of predictions on the validation data that the residual tests need.
_MIN_RESIDUALS = 3


@document_settings(Settings, "changes", of_preset=True)
def identify(
    record: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | Sequence[str] | None = None,
    validation: "RecordLike | float" = 0.25,
    refine_together: bool = True,
    preset: str | Choice = AUTO,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    on_epoch: SearchCallback | None = None,
    stop: Stop = never_stop,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    reading: "ReadingLike" = DEFAULT_READING,
    **changes: Any,
) -> Result:
    """Identify a model of a record by evolution.

    Of several outputs, the model has one equation per output, which are simulated together; see
    `islands.facade.coupled.identification.identify_outputs`.

    Parameters
    ----------
    record : record, data frame or array
        Data without missing values, as `as_record` takes them: a `Dataset`; a frame of pandas or polars or an
        xarray Dataset, with ``inputs`` and ``output``; or the inputs as an array, followed by ``y`` and
        ``dt``.
    y : array, optional
        The output, of shape (samples,), or several, of shape (samples, outputs), if ``record`` is an array.
    dt : float, optional
        Sampling time in seconds. A frame with a time, as its index or as a column, does not need it.
    inputs, output
        Names of the columns of a frame; ``output`` is one name or several.
    validation : record, data frame or float
        Data that select among the hall of fame: a separate record, or the fraction at the end of ``record``.
    refine_together : bool
        Whether the parameters of the equations of several outputs are refined on their common free run.
    preset : str or Choice
        An entry of ``PRESETS``, or ``auto``, which chooses library, primitives, constraints and lags by
        fits that are compared on the validation data. A choice of `choose_preset` is not made again. It has
        the settings that are not given. Of several outputs, ``auto`` is ``narx``.
    seed : int
        Seed of the random generator; the same seed gives the same result, bit for bit.
    progress : callable, optional
        Called with a message and the completed fraction of each stage before and after the epochs.
    on_epoch : callable, optional
        Called with the `SearchState` and the `Settings` after every epoch, of the search of each output.
    stop : callable, optional
        Called frequently. Once it returns true, the present step ends with the best models so far, and those
        after it are left out: refinement, prediction bands. ``search.ended_by`` of the result is ``stopped``.
    start : SearchState, optional
        State to continue from; the result equals that of an uninterrupted run.
    engine : str, Ray or Engine, optional
        What runs the islands: ``serial`` (the default), ``ray`` on all cores of this machine,
        ``islands.Ray(address=..., cpus=...)``, or an engine. The result is the same, bit for bit.
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    **changes

    Returns
    -------
    Result
        Best model of every size, least validation error first.

    Raises
    ------
    SettingsError
        A setting is unknown or out of range, or no model was found.
    StoppedError
        ``stop`` returned true before the first models were found, or before every output had some.
    RecordError
        The record is too short or incomplete, or the validation data do not match it.
    ModelError
        The function of a primitive of your own does not compile.

    Warns
    -----
    ExtrapolationWarning
        An input of the validation data leaves the range of the estimation data.
    """
    record, validation = read_data(record, y, dt, inputs, output, validation, reading)
    warn_of_extrapolation(split_first(record, validation))
    return identify_record(
        record,
        validation,
        refine_together=refine_together,
        preset=preset,
        seed=seed,
        progress=progress,
        on_epoch=on_epoch,
        stop=stop,
        start=start,
        engine=engine,
        **changes,
    )


def identify_record(
    record: AnyRecord,
    validation: AnyRecord | float = 0.25,
    *,
    refine_together: bool = True,
    preset: str | Choice = AUTO,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    on_epoch: SearchCallback | None = None,
    stop: Stop = never_stop,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    on_models: ResultCallback = ignore_result,
    **changes: Any,
) -> Result:
    """Identify a model of a record as `identify` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    record : Dataset or CoupledRecord
    validation : Dataset, CoupledRecord or float
    refine_together, preset, seed, progress, on_epoch, stop, start, engine, **changes
        As for `identify`.
    on_models : callable
        Called with the ranked models of each output, before the optional steps.

    Raises
    ------
    SettingsError, StoppedError, RecordError, ModelError
        As `identify`.
    """
    check_seed(seed)
    steps = Steps(progress, stop)
    if isinstance(record, CoupledRecord):
        if isinstance(preset, Choice):
            raise SettingsError("a choice of auto is for one output: name a preset of several outputs")
        return identify_outputs(
            split_coupled(record, validation),
            partial(identify_record, seed=seed, engine=engine, on_models=on_models),
            refine_together,
            seed,
            steps,
            changes,
            preset=preset,
            start=start,
            on_epoch=on_epoch,
        )
    assert not isinstance(validation, CoupledRecord)
    parts = split_data(record, validation)
    if preset == AUTO:
        try:
            preset = choose_preset(record, validation, changes, progress, stop)
        except StoppedChoiceError as stopped:
            return Result.from_search(stopped.found)
    if isinstance(preset, Choice):
        settings = resolve_kind(preset.kind, preset.delays, with_tuples(changes))
    else:
        settings = resolve_settings(preset, with_tuples(changes))
    held_out = record_document(validation) if isinstance(validation, Dataset) else validation
    if settings.model_class == LATENT:
        described = {**_describe_preset(preset), "validation": held_out}
        found = search_latent(
            *(record, parts, settings, seed, steps, described),
            start=start,
            engine=engine,
            on_epoch=on_epoch or ignore_epoch,
        )
        on_models(found)
        return Result.from_search(refit_models(complete_latent(found, steps), validation, steps))
    for entry in _own_primitives(settings):
        row_address(entry)  # compile it before the search starts
    steps("sampling rate and direct feedthrough", 0.0)
    trial, least = make_trial_library(settings), settings.maximum_lag + _MIN_RESIDUALS
    split, count = select_rate(parts, settings.average, trial, least, steps)
    split = select_feedthrough(split, settings.feedthrough, trial.at_rate(count))
    _check_validation_length(split.validation, settings)
    offsets = _find_search_offsets(split.estimation, settings)
    scaled = replace(
        settings,
        shooting=count_means(settings.shooting, count),
        library_delays=tuple(delay // count for delay in settings.library_delays),
    )
    search_problem = replace(
        make_problem(subtract_offsets(split.estimation, offsets), scaled, steps), offsets=offsets
    )
    state = begin_search(start, settings.islands, seed)
    with open_engine(engine, progress) as opened:
        state = evolve(search_problem, state, settings, opened, steps, on_epoch or ignore_epoch)
    if state.archipelago.generation < 0 and not search_problem.seeds:
        raise StoppedError("first populations")
    hall_of_fame = state.archipelago.hall_of_fame
    candidates = estimate_candidates(hall_of_fame, search_problem, split, offsets, steps)
    progress("assessment of the final models", 1.0)
    models = select_final_models(candidates, search_problem, split, steps)
    if not models:
        raise SettingsError(
            f"no model was found: {dict(state.outcomes)}; take another preset, more generations or a longer "
            "record"
        )
    described = {**_describe_preset(preset), **_describe(settings), "validation": held_out}
    statistics = _make_statistics(state, hall_of_fame, search_problem)
    simple = _list_simple_models(split, scaled, steps, chosen=isinstance(preset, Choice))
    models, candidates = rank_models([*models, *simple]), [*candidates, *map(as_candidate, simple)]
    warm_up = max([settings.maximum_lag, *(entry.model.maximum_lag for entry in simple)])
    found = SearchResult(record, split, seed, described, statistics, models)
    on_models(with_average(found, count))
    banded = with_bands(found, candidates, settings.constraints, warm_up, steps)
    return Result.from_search(refit_models(with_average(banded, count), validation, steps))


def _list_simple_models(split: Split, settings: Settings, steps: Steps, *, chosen: bool) -> list[Assessment]:
    """Return the linear model, and those with one curve if the preset is chosen automatically.

    There are none if the settings select by another error or state the noise.
    """
    if settings.select == "fitness" or settings.estimator not in ("", "free-run"):
        return []
    limits = settings.shooting, settings.maximum_lag, settings.constraints
    return list_simple_models(split, *limits, steps, curves=chosen)


def _own_primitives(settings: Settings) -> list[Primitive]:
    return [entry for name, entry in settings.primitive_table.items() if name not in PRIMITIVES]


def _describe_preset(preset: str | Choice) -> dict[str, Any]:
    """Return the preset, with the choice of ``auto``, as JSON values."""
    if isinstance(preset, Choice):
        return {"method": "identify", "preset": AUTO, "choice": preset.to_document()}
    return {"method": "identify", "preset": preset}


def _describe(settings: Settings) -> dict[str, Any]:
    """Return settings as JSON values. The source of each primitive of the user is in ``own_primitives``."""
    document = {each.name: getattr(settings, each.name) for each in fields(settings)}
    document["primitives"] = tuple(
        entry.name if isinstance(entry, Primitive) else entry for entry in settings.primitives
    )
    if own := _own_primitives(settings):
        document["own_primitives"] = {entry.name: get_source(entry) for entry in own}
    return document


def _check_validation_length(validation: Dataset, settings: Settings) -> None:
    # Check before the search starts, not after it.
    needed = settings.maximum_lag + _MIN_RESIDUALS
    if max(validation.segments) < needed:
        raise RecordError(
            f"the longest recording of the validation data has {max(validation.segments)} samples: lags up "
            f"to {settings.maximum_lag} need {needed}; give more data or a smaller max_height"
        )


def _find_search_offsets(record: Dataset, settings: Settings) -> Offsets:
    # A function such as a square root of a deviation differs from that of the signal.
    is_shiftable = SHIFTABLE.issuperset(settings.primitives)
    return find_offsets(record, settings.constraints, LARGE_OFFSET) if is_shiftable else no_offsets(record)


def _make_statistics(state: SearchState, hall_of_fame: HallOfFame, problem: Problem) -> SearchStatistics:
    maximum_lag, degree = _maximum_lag_and_degree(hall_of_fame)
    inputs = problem.record.inputs
    count = full_set(degree, maximum_lag, maximum_lag, inputs)
    rows = sum(max(0, length - problem.settings.maximum_lag) for length in problem.record.segments)
    return SearchStatistics(
        state.evaluations,
        dict(state.outcomes),
        {"candidates": count, "bytes": 8 * count * rows, "degree": degree, "lags": maximum_lag},
        None,
        state.archipelago.generation,
        state.duplicates,
        sum(state.outcomes.get(name, 0) for name in FEASIBLE_OUTCOMES) / max(1, state.evaluations),
        state.history,
        state.caches,
        stop_reason(state, problem.settings) or "stopped",
    )


def _maximum_lag_and_degree(hall_of_fame: HallOfFame) -> tuple[int, int]:
    """Return the largest lag and the largest degree of a regressor in the hall of fame."""
    regressors = [item for entry in hall_of_fame.entries for item in require_genes(entry).regressors]
    maximum_lag = max((item.maximum_lag for item in regressors), default=1)
    return max(1, maximum_lag), max((item.degree for item in regressors), default=1)
