"""Identification by evolution (MGGP/FROE), refinement and validation."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from islands.errors import SettingsError, check_seed
from islands.evolution.engine import Engine
from islands.evolution.presets import AUTO, resolve_kind, resolve_settings, with_tuples
from islands.evolution.search_result import (
    ResultCallback,
    SearchResult,
    add_models,
    as_candidate,
    complete_search,
    ignore_result,
    list_simple_models,
    with_average,
)
from islands.evolution.search_state import SearchState
from islands.evolution.settings import LATENT, Settings
from islands.facade.automatic.choice import Choice
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.coupled.identification import identify_outputs
from islands.facade.engine_choice import Ray
from islands.facade.equation_search import count_needed, search_equations
from islands.facade.evolution_run import SearchCallback, ignore_epoch
from islands.facade.front import StoppedFitError
from islands.facade.latent_identification import search_latent
from islands.facade.refit import refit_models
from islands.facade.results.identification import Result
from islands.facade.trials.library import make_trial_library
from islands.facade.trials.prepared_data import PreparedData, prepare_data, restore_data
from islands.parallel import one_blas_thread
from islands.progress import ProgressCallback, Steps, Stop, ignore_progress, never_stop
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


@one_blas_thread
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
    on_front: ResultCallback | None = None,
    on_models: ResultCallback = ignore_result,
    equations_only: bool = False,
    **changes: Any,
) -> Result:
    """Identify a model of a record as `identify` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    record : Dataset or CoupledRecord
    validation : Dataset, CoupledRecord or float
    refine_together, preset, seed, progress, on_epoch, stop, start, engine, **changes
        As for `identify`.
    on_front : callable, optional
        Called with the models of one output so far, whenever fits of the preset ``auto`` add some.
    on_models : callable
        Called with the ranked models of each output, before the optional steps.
    equations_only : bool
        Whether models that are no equation of a library, as the linear one, are left out.

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
            partial(identify_record, seed=seed, engine=engine, on_front=on_front, on_models=on_models),
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
            preset = choose_preset(record, validation, changes, progress, stop, on_front)
        except StoppedFitError as stopped:
            return Result.from_search(stopped.found)
    if isinstance(preset, Choice):
        settings = resolve_kind(preset.kind, preset.delays, with_tuples(changes))
    else:
        settings = resolve_settings(preset, with_tuples(changes))
    held_out = record_document(validation) if isinstance(validation, Dataset) else validation
    data = _prepare(parts, settings, preset, steps)
    described = {**_describe_preset(preset), "validation": held_out}
    # The data of a choice have the inputs of direct paths; otherwise a latent search finds them.
    direct = data.is_early or not isinstance(preset, Choice)
    is_latent = settings.model_class == LATENT
    search = partial(search_latent, direct=direct) if is_latent else search_equations
    found, candidates = search(
        *(record, data, settings, seed, steps, described),
        start=start,
        engine=engine,
        on_epoch=on_epoch or ignore_epoch,
    )
    others = [] if equations_only else _list_others(found, settings, preset, steps)
    found = add_models(found, others)
    on_models(with_average(found, found.average))
    completed = complete_search(found, [*candidates, *map(as_candidate, others)], steps)
    return Result.from_search(refit_models(completed, validation, steps))


def _prepare(parts: Split, settings: Settings, preset: str | Choice, steps: Steps) -> PreparedData:
    """Return the data of a search; those of a choice were prepared for its fits."""
    if isinstance(preset, Choice):
        return restore_data(parts, preset.data)
    if settings.model_class == LATENT:
        return PreparedData(parts)
    trial, least = make_trial_library(settings), count_needed(settings)
    return prepare_data(parts, settings.average, settings.feedthrough, trial, least, steps)


def _list_others(
    found: SearchResult, settings: Settings, preset: str | Choice, steps: Steps
) -> list[Assessment]:
    """Return the models that compete with those of a search: the front of a choice, or the linear one.

    There are none if the settings select by another error or state the noise.
    """
    if settings.select == "fitness" or settings.estimator not in ("", "free-run"):
        return []
    interval = found.shooting_interval
    if isinstance(preset, Choice) and preset.models:
        return preset.assess_models(found.split, interval, settings.constraints)
    warm_up = min(entry.warm_up for entry in found.models)
    limits = interval, warm_up, settings.constraints
    return list_simple_models(found.split, *limits, steps, curves=isinstance(preset, Choice))


def _describe_preset(preset: str | Choice) -> dict[str, Any]:
    """Return the preset, with the choice of ``auto``, as JSON values."""
    if isinstance(preset, Choice):
        return {"method": "identify", "preset": AUTO, "choice": preset.to_document()}
    return {"method": "identify", "preset": preset}
