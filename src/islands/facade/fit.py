"""Fit by subset selection over a candidate library."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Unpack

from numpy.typing import ArrayLike

from islands.errors import SettingsError, check_seed, name_option
from islands.evolution.search_result import ResultCallback, SearchResult, ignore_result
from islands.facade.automatic.kind_choice import StoppedChoiceError
from islands.facade.automatic.preset_choice import fit_chosen_library
from islands.facade.class_fit import fit_class
from islands.facade.library_fit import FitChanges, FitSettings
from islands.facade.refit import refit_models
from islands.facade.results.identification import Result
from islands.models.latent import LatentModel
from islands.persistence.models import NARX
from islands.progress import (
    ProgressCallback,
    Steps,
    Stop,
    ignore_progress,
    never_stop,
)
from islands.records.averaging import AUTO
from islands.records.dataset import Dataset
from islands.records.reading.data_frames import read_data
from islands.records.reading.options import DEFAULT_READING
from islands.records.split import split_data, warn_of_extrapolation
from islands.report.documents.result_folder import record_document

if TYPE_CHECKING:
    from narwhals.typing import IntoSeries

    from islands.records.reading.data_frames import ReadingLike, RecordLike


def fit(
    record: "RecordLike",
    y: "ArrayLike | IntoSeries | None" = None,
    dt: float | None = None,
    *,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    validation: "RecordLike | float" = 0.25,
    model: str = NARX,
    structure: str = AUTO,
    library: str = AUTO,
    degree: int | None = None,
    lags: int | None = None,
    delays: Sequence[int] | None = None,
    max_terms: int = 10,
    constraints: str | None = None,
    estimator: str = "",
    refit: str = "none",
    average: int | str = AUTO,
    feedthrough: str = AUTO,
    shooting: int | None = None,
    certificate: int = 10_000,
    seed: int = 0,
    reading: "ReadingLike" = DEFAULT_READING,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
) -> Result:
    """Fit models of increasing size to a record by subset selection and rank them on validation data.

    With another ``model`` than ``narx``, fit the model of a class with named parameters by the error of its
    free run; all settings from ``library`` to ``certificate`` except ``refit`` are those of NARX
    models. Latent models have ``constraints`` as well.

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
    model : str
        Class of the models: ``narx``, or an entry of ``MODEL_CLASSES``.
    structure : str
        Structure of latent models, which has zeros: ``wiener``, ``hammerstein``, ``feedback``, or ``auto``
        for any.
    library : str
        An entry of ``LIBRARIES``, such as ``phi-polynomial`` for hysteresis or ``polynomial`` for smooth
        systems. ``auto`` fits several libraries and takes the best one, as the preset ``auto`` does.
    degree, lags : int, optional
        Degree and lags of the library; None takes the defaults of the library.
    delays : sequence of int, optional
        Dead times by which the library reads the inputs later, in samples of the record: one, or one for each
        input. None estimates them with the library ``auto``, and is none with others.
    max_terms : int
        Size of the largest model, apart from a constant that an offset of the signals requires.
    constraints : str, optional
        ``hysteresis``, ``none`` or statements such as ``odd; gain = 2.5``; None takes the default of the
        library. Those of latent models are ``gain``, ``fixed-point`` and ``odd``.
    estimator : str
        An entry of ``ESTIMATORS``, which estimates the parameters of the selected structures. By default,
        they are those of least squares or, if the validation data prefer it, of the error of the free run.
    refit : str
        ``all`` estimates the parameters of the ranked models again in the end, on estimation and validation
        data together. The errors of the result remain those of the parameters before, since no data are left
        to measure the others. An entry of ``REFITS``; for models of every class.
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
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    progress : callable, optional
        Called with a message and the completed fraction.
    stop : callable, optional
        Called before each step. Once it returns true, the fit ends with the models so far, without prediction
        bands; ``search.ended_by`` of the result is ``stopped``.

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
    return fit_record(
        record,
        validation,
        model=model,
        structure=structure,
        library=library,
        degree=degree,
        lags=lags,
        delays=delays,
        constraints=constraints,
        seed=seed,
        progress=progress,
        stop=stop,
        max_terms=max_terms,
        estimator=estimator,
        refit=refit,
        average=average,
        feedthrough=feedthrough,
        shooting=shooting,
        certificate=certificate,
    )


def fit_record(
    record: Dataset,
    validation: Dataset | float = 0.25,
    *,
    model: str = NARX,
    structure: str = AUTO,
    library: str = AUTO,
    degree: int | None = None,
    lags: int | None = None,
    delays: Sequence[int] | None = None,
    constraints: str | None = None,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    on_models: ResultCallback = ignore_result,
    **changes: Unpack[FitChanges],
) -> Result:
    """Fit models to a record as `fit` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    record : Dataset
    validation : Dataset or float
    model, structure, library, degree, lags, delays, constraints, seed, progress, stop
        As for `fit`.
    on_models : callable
        Called with the ranked models, before the optional steps.
    **changes
        Settings that differ from those of `FitSettings`.

    Raises
    ------
    SettingsError, StoppedError, RecordError
        As `fit`.
    """
    check_seed(seed)
    if structure != AUTO and model != LatentModel.kind:
        raise SettingsError(
            f"a structure is a setting of latent models: leave it out, or {name_option('model', 'latent')}"
        )
    settings = FitSettings(**changes)
    split = split_data(record, validation)
    held_out = record_document(validation) if isinstance(validation, Dataset) else validation
    if model != NARX:
        stated = None if model == LatentModel.kind else constraints
        given = library, degree, lags, delays, stated, settings
        if given != (AUTO, None, None, None, None, FitSettings(refit=settings.refit)):
            raise SettingsError(
                f"library, max_terms and so on are settings of NARX models, not for the model {model}: "
                "leave them out"
            )
        stated = "none" if constraints is None else constraints
        described = {"refit": settings.refit, "validation": held_out}

        def keep(found: SearchResult) -> None:
            on_models(replace(found, settings={**found.settings, **described}))

        found = fit_class(record, split, model, structure, stated, seed, Steps(progress, stop), keep)
        found = replace(found, settings={**found.settings, **described})
        return Result.from_search(refit_models(found, validation, Steps(progress, stop)))
    try:
        fit = fit_chosen_library(
            record, split, library, degree, lags, constraints, delays, settings, seed, progress, stop
        ).with_settings(validation=held_out)
        on_models(fit.incomplete)
        found = fit.complete()
    except StoppedChoiceError as stopped:
        found = replace(stopped.found, settings={**stopped.found.settings, "validation": held_out})
    return Result.from_search(refit_models(found, validation, Steps(progress, stop)))
