"""Fit by subset selection over a candidate library."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from islands.errors import check_seed
from islands.evolution.search_result import ResultCallback, SearchResult, ignore_result
from islands.evolution.settings import NARX
from islands.facade.automatic.preset_choice import fit_chosen_library
from islands.facade.class_fit import fit_class
from islands.facade.coupled.identification import fit_outputs
from islands.facade.fit_settings import FitSettings
from islands.facade.front import StoppedFitError
from islands.facade.refit import refit_models
from islands.facade.results.identification import Result
from islands.parallel import one_blas_thread
from islands.progress import (
    ProgressCallback,
    Steps,
    Stop,
    ignore_progress,
    never_stop,
)
from islands.records.coupled import AnyRecord, CoupledRecord, split_coupled, split_first
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
    output: str | Sequence[str] | None = None,
    validation: "RecordLike | float" = 0.25,
    refine_together: bool = True,
    seed: int = 0,
    reading: "ReadingLike" = DEFAULT_READING,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    **settings: Any,
) -> Result:
    """Fit models of increasing size to a record by subset selection and rank them on validation data.

    Of several outputs, the model has one equation per output, which are simulated together; see
    `islands.facade.coupled.identification.fit_outputs`.

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
        Data that rank the models: a separate record, or the fraction at the end of ``record``.
    refine_together : bool
        Whether the parameters of the equations of several outputs are refined on their common free run.
    seed : int
        Stored in the result; forward selection is deterministic.
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    progress : callable, optional
        Called with a message and the completed fraction.
    stop : callable, optional
        Called before each step. Once it returns true, the fit ends with the models so far, without prediction
        bands; ``search.ended_by`` of the result is ``stopped``. Several outputs share the time of a
        `TimeLimit`.
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
        ``stop`` returned true before the first model, or before every output had one.
    RecordError
        The record is too short or incomplete, or the validation data has other columns or sampling time.

    Warns
    -----
    ExtrapolationWarning
        An input of the validation data leaves the range of the estimation data.
    """
    record, validation = read_data(record, y, dt, inputs, output, validation, reading)
    warn_of_extrapolation(split_first(record, validation))
    return fit_record(
        record,
        validation,
        refine_together=refine_together,
        seed=seed,
        progress=progress,
        stop=stop,
        **settings,
    )


@one_blas_thread
def fit_record(
    record: AnyRecord,
    validation: AnyRecord | float = 0.25,
    *,
    refine_together: bool = True,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    on_front: ResultCallback | None = None,
    on_models: ResultCallback = ignore_result,
    equations_only: bool = False,
    **changes: Any,
) -> Result:
    """Fit models to a record as `fit` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    record : Dataset or CoupledRecord
    validation : Dataset, CoupledRecord or float
    refine_together, seed, progress, stop, **changes
        As for `fit`.
    on_front : callable, optional
        Called with the models of one output so far, whenever some are added.
    on_models : callable
        Called with the ranked models of each output, before the optional steps.
    equations_only : bool
        Whether models that are no equation of a library, as the linear one, are left out.

    Raises
    ------
    SettingsError, StoppedError, RecordError
        As `fit`.
    """
    check_seed(seed)
    settings = FitSettings(**changes)
    if isinstance(record, CoupledRecord):
        find = partial(fit_record, seed=seed, on_front=on_front, on_models=on_models)
        data = split_coupled(record, validation)
        return fit_outputs(data, find, refine_together, seed, Steps(progress, stop), changes)
    assert not isinstance(validation, CoupledRecord)
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
        fit = fit_chosen_library(record, split, settings, seed, progress, stop, on_front, equations_only)
        fit = fit.with_settings(validation=held_out)
        on_models(fit.incomplete)
        found = fit.complete()
    except StoppedFitError as stopped:
        found = replace(stopped.found, settings={**stopped.found.settings, "validation": held_out})
    return Result.from_search(refit_models(found, validation, Steps(progress, stop)))
