"""Choices of the preset ``auto`` for `identify` and of the library ``auto`` for `fit`."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.presets import AUTO, resolve_kinds, resolve_latent, with_tuples
from islands.facade.automatic.kind_choice import Choice, choose_kind
from islands.facade.automatic.latent_trial import LATENT_TRIAL, compare_latent
from islands.facade.fit_settings import FitSettings
from islands.facade.library_fit import LibraryFit, fit_library
from islands.facade.trials.library import TrialLibrary, make_trial_library, take_library
from islands.progress import ProgressCallback, Steps, Stop, ignore_progress, never_stop
from islands.records.dataset import Dataset
from islands.records.split import Split, split_data

#: Why latent models are not compared with models of hysteresis.
_NO_CONTINUUM = "Latent models, which have no continuum of equilibria, were not compared."


def choose_preset(
    record: Dataset,
    validation: Dataset | float,
    changes: Mapping[str, Any],
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
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

    Raises
    ------
    StoppedError
        ``stop`` returned true; see `choose_kind`.
    SettingsError, RecordError
        As in `islands.identify`.
    """
    changes = with_tuples(changes)
    constraint(changes.get("constraints", "none")).check_inputs(record.inputs)
    libraries = {kind: make_trial_library(each) for kind, each in resolve_kinds(changes).items()}
    split = split_data(record, validation)
    common = {name: changes[name] for name in ("average", "feedthrough", "shooting") if name in changes}
    fit_kind = partial(fit_library, record, split, settings=FitSettings(**common), stop=stop)
    steps = Steps(progress, stop)
    delays = changes.get("library_delays")
    choice, fits = choose_kind(split.estimation, libraries, delays, fit_kind, steps)
    settings = resolve_latent(changes)
    # Models of hysteresis keep a property that latent models do not have.
    constrained = constraint(libraries[choice.kind].constraints).sums
    if settings is None or not record.output_range > 0.0:
        return choice
    if constrained:
        return replace(choice, reasons=(*choice.reasons, _NO_CONTINUUM))
    try:
        fit = fits.get(choice.kind) or fit_kind(libraries[choice.kind].with_delays(choice.delays))
    except (SettingsError, RecordError, ModelError):
        return choice  # The search reports what is wrong.
    return compare_latent(record, split, choice, fit, replace(settings, **LATENT_TRIAL), steps)


def fit_chosen_library(
    record: Dataset,
    split: Split,
    settings: FitSettings,
    seed: int,
    progress: ProgressCallback,
    stop: Stop,
) -> LibraryFit:
    """Fit a library, or the one that is chosen if its name is ``auto``; see `islands.fit`.

    Settings that are None are chosen, or have the default of the library.

    Raises
    ------
    SettingsError, RecordError
        As in `islands.fit`.
    """
    degree, lags, constraints = settings.degree, settings.lags, settings.constraints
    constraint(constraints or "none").check_inputs(record.inputs)
    fit_one = partial(fit_library, record, split, settings=settings, seed=seed, progress=progress, stop=stop)
    if settings.library != AUTO:
        return fit_one(take_library(settings.library, degree, lags, constraints, settings.delays or ()))
    kinds = resolve_kinds({} if constraints is None else {"constraints": constraints})
    libraries = {kind: take_library(each.library, degree, lags, constraints) for kind, each in kinds.items()}
    choice, fits = choose_kind(split.estimation, libraries, settings.delays, fit_one, Steps(progress, stop))
    chosen = fits.get(choice.kind) or fit_one(libraries[choice.kind].with_delays(choice.delays))
    return chosen.with_settings(choice=_name_by_model(choice, libraries, chosen).to_document())


def _name_by_model(choice: Choice, libraries: Mapping[str, TrialLibrary], fit: LibraryFit) -> Choice:
    """Return the choice with the first kind whose library has all terms of the recommended model.

    A larger library may be the only one in which a search finds a model of a smaller one.
    """
    for kind, library in libraries.items():
        if kind == choice.kind:
            break
        if fit.is_within(library.with_delays(choice.delays)):
            sentence = f"Its recommended model has terms of {kind} alone."
            return replace(choice, kind=kind, reasons=(*choice.reasons, sentence))
    return choice
