"""Choices of the preset ``auto`` for `identify` and of the library ``auto`` for `fit`."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from islands.estimation.parameter_constraints import constraint
from islands.evolution.presets import AUTO, accepts_fits, resolve_kinds, resolve_latent, with_tuples
from islands.evolution.search_result import ResultCallback
from islands.facade.automatic.choice import Choice, keep_models
from islands.facade.automatic.kind_choice import choose_kind
from islands.facade.automatic.latent_trial import LATENT_TRIAL, compare_latent
from islands.facade.fit_settings import FitSettings
from islands.facade.front import Front, StoppedFitError, find_linear_result, list_simple
from islands.facade.library_fit import fit_library
from islands.facade.trials.library import TrialLibrary, make_trial_library, take_library
from islands.facade.trials.prepared_data import prepare_data
from islands.models.candidate_library import count_inputs
from islands.progress import ProgressCallback, Steps, Stop, StoppedError, ignore_progress, never_stop
from islands.records.dataset import Dataset
from islands.records.split import Split, split_data

#: Why latent models are not compared with models of hysteresis.
_NO_CONTINUUM = "Latent models, which have no continuum of equilibria, were not compared."

#: Settings of a search that its fits have as well.
_COMMON = ("average", "feedthrough", "shooting", "max_terms")

#: Samples besides the lags that a search needs.
_MORE_SAMPLES = 3


def choose_preset(
    record: Dataset,
    validation: Dataset | float,
    changes: Mapping[str, Any],
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    on_front: ResultCallback | None = None,
) -> Choice:
    """Choose the kind of record and the dead times of the preset ``auto`` for ``identify``.

    Parameters
    ----------
    record : Dataset
    validation : Dataset or float
        Validation data or fraction.
    changes : mapping
        Settings of the user, which take precedence over the choice.
    progress : callable, optional
        Called with a message and the completed fraction.
    stop : callable, optional
        Called between all steps.
    on_front : callable, optional
        Called with the result of all models so far; see `choose_kind`.

    Raises
    ------
    StoppedError
        ``stop`` returned true; see `choose_kind`.
    SettingsError, RecordError
        As in `islands.identify`.
    """
    changes = with_tuples(changes)
    constraint(changes.get("constraints", "none")).check_inputs(record.inputs)
    searches = resolve_kinds(changes)
    libraries = {kind: make_trial_library(each) for kind, each in searches.items()}
    split = split_data(record, validation)
    common = {name: changes[name] for name in _COMMON if name in changes}
    given = FitSettings(**common, delays=changes.get("library_delays"))
    least = max(each.maximum_lag for each in searches.values()) + _MORE_SAMPLES
    steps = Steps(progress, stop)
    choice, front = choose_kind(record, split, libraries, given, least, 0, steps, on_front)
    if front is None or not record.output_range > 0.0:
        return choice
    models = list(front.found.models)
    settings = resolve_latent(changes)
    # Models of hysteresis keep a property that latent models do not have.
    constrained = constraint(libraries[choice.kind].constraints).sums
    if settings is not None and constrained:
        choice = replace(choice, reasons=(*choice.reasons, _NO_CONTINUUM))
    elif settings is not None:
        trial = replace(settings, **LATENT_TRIAL)
        choice, latent = compare_latent(record, front, choice, trial, steps)
        models += latent
    return replace(choice, models=keep_models(models)) if accepts_fits(changes) else choice


def fit_chosen_library(
    record: Dataset,
    split: Split,
    settings: FitSettings,
    seed: int,
    progress: ProgressCallback,
    stop: Stop,
    on_front: ResultCallback | None = None,
    equations_only: bool = False,
) -> Front:
    """Fit a library, or the one that is chosen if its name is ``auto``; see `islands.fit`.

    Settings that are None are chosen, or have the default of the library. With ``equations_only``, a library
    that is named has no models of another kind.

    Raises
    ------
    SettingsError, RecordError
        As in `islands.fit`.
    """
    degree, lags, constraints = settings.degree, settings.lags, settings.constraints
    constraint(constraints or "none").check_inputs(record.inputs)
    steps = Steps(progress, stop)

    fit_one = partial(_fit_one, record, split, settings, seed, steps, equations_only)
    if settings.library != AUTO:
        library = take_library(settings.library, degree, lags, constraints, settings.delays or ())
        count_inputs(
            library.name, library.degree, library.lags, record.inputs
        )  # refuses one that is too large
        if equations_only:
            return fit_one(library)
        linear = find_linear_result(record, split, library, settings, seed, steps)
        if linear and on_front:
            on_front(linear)
        try:
            return fit_one(library)
        except StoppedError as stopped:
            if linear is None:
                raise
            raise StoppedFitError(stopped.step, linear, ()) from stopped
    kinds = resolve_kinds({} if constraints is None else {"constraints": constraints})
    libraries = {kind: take_library(each.library, degree, lags, constraints) for kind, each in kinds.items()}
    least = max(map(_count_needed, libraries.values()))
    choice, front = choose_kind(record, split, libraries, settings, least, seed, steps, on_front)
    # Without a model, the fit of the chosen library reports what is wrong.
    front = front or fit_one(libraries[choice.kind].with_delays(choice.delays))
    return front.with_settings(choice=_name_by_model(choice, libraries, front).to_document())


def _fit_one(
    record: Dataset,
    split: Split,
    settings: FitSettings,
    seed: int,
    steps: Steps,
    equations_only: bool,
    library: TrialLibrary,
) -> Front:
    """Return the front of one library."""
    least = _count_needed(library)
    data = prepare_data(split, settings.average, settings.feedthrough, library, least, steps)
    fit = fit_library(record, data, library, settings, seed, steps)
    simple = [] if equations_only else list_simple(data, library, settings, steps)
    return Front(fit, simple=tuple(simple))


def _count_needed(library: TrialLibrary) -> int:
    """Return the fewest samples of a segment that permit a prediction."""
    return library.lags + _MORE_SAMPLES + max(library.delays, default=0)


def _name_by_model(choice: Choice, libraries: Mapping[str, TrialLibrary], front: Front) -> Choice:
    """Return the choice with the first kind whose library has all terms of the recommended model.

    A larger library may be the only one in which a search finds a model of a smaller one.
    """
    model = front.found.recommended.model
    for kind, library in libraries.items():
        if front.fit.contains(model, library.with_delays(choice.delays)):
            if kind == choice.kind:
                break
            sentence = f"The recommended model has terms of {kind}."
            return replace(choice, kind=kind, reasons=(*choice.reasons, sentence))
    return choice
