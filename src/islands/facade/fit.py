"""Fit by subset selection over a candidate library."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from islands.errors import check_seed
from islands.evolution.search_result import ResultCallback, SearchResult, ignore_result
from islands.evolution.settings import NARX
from islands.facade.automatic.kind_choice import StoppedChoiceError
from islands.facade.automatic.preset_choice import fit_chosen_library
from islands.facade.class_fit import fit_class
from islands.facade.fit_settings import FitSettings
from islands.facade.refit import refit_models
from islands.facade.results.identification import Result
from islands.progress import (
    ProgressCallback,
    Steps,
    Stop,
    ignore_progress,
    never_stop,
)
from islands.records.dataset import Dataset
from islands.records.reading.data_frames import read_data
from islands.records.reading.options import DEFAULT_READING
from islands.records.split import split_data, warn_of_extrapolation
from islands.report.documents.result_folder import record_document
from islands.settings_schema import document_settings

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.records.reading.data_frames import ReadingLike, RecordLike


@document_settings(FitSettings, "settings")
def fit(
    record: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    validation: "RecordLike | float" = 0.25,
    seed: int = 0,
    reading: "ReadingLike" = DEFAULT_READING,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    **settings: Any,
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
    seed : int
        Stored in the result; forward selection is deterministic.
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    progress : callable, optional
        Called with a message and the completed fraction.
    stop : callable, optional
        Called before each step. Once it returns true, the fit ends with the models so far, without prediction
        bands; ``search.ended_by`` of the result is ``stopped``.
    **settings

    Returns
    -------
    Result
        Models of every size, least validation error first. ``result.best`` is the recommended one.

    Raises
    ------
    SettingsError
        A setting is unknown or out of range, or no model could be estimated.
    StoppedError
        ``stop`` returned true before the first model.
    RecordError
        The record is too short or incomplete, or the validation data has other columns or sampling time.

    Warns
    -----
    ExtrapolationWarning
        An input of the validation data leaves the range of the estimation data.
    """
    record, validation = read_data(record, y, dt, inputs, output, validation, reading)
    warn_of_extrapolation(split_data(record, validation))
    return fit_record(record, validation, seed=seed, progress=progress, stop=stop, **settings)


def fit_record(
    record: Dataset,
    validation: Dataset | float = 0.25,
    *,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    on_models: ResultCallback = ignore_result,
    **changes: Any,
) -> Result:
    """Fit models to a record as `fit` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    record : Dataset
    validation : Dataset or float
    seed, progress, stop, **changes
        As for `fit`.
    on_models : callable
        Called with the ranked models, before the optional steps.

    Raises
    ------
    SettingsError, StoppedError, RecordError
        As `fit`.
    """
    check_seed(seed)
    settings = FitSettings(**changes)
    split = split_data(record, validation)
    held_out = record_document(validation) if isinstance(validation, Dataset) else validation
    if settings.model != NARX:
        described = {"refit": settings.refit, "validation": held_out}

        def keep(found: SearchResult) -> None:
            on_models(replace(found, settings={**found.settings, **described}))

        found = fit_class(record, split, settings, seed, Steps(progress, stop), keep)
        found = replace(found, settings={**found.settings, **described})
        return Result.from_search(refit_models(found, validation, Steps(progress, stop)))
    try:
        fit = fit_chosen_library(record, split, settings, seed, progress, stop)
        fit = fit.with_settings(validation=held_out)
        on_models(fit.incomplete)
        found = fit.complete()
    except StoppedChoiceError as stopped:
        found = replace(stopped.found, settings={**stopped.found.settings, "validation": held_out})
    return Result.from_search(refit_models(found, validation, Steps(progress, stop)))
