"""Choice of the preset ``auto``: kind of record and dead times.

Trials on the estimation data exclude kinds (see `try_kinds`). The others are fitted, and their recommended
models are compared on the validation data.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, lcm
from types import MappingProxyType
from typing import Any

from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.search_result import BANDS, SearchResult
from islands.facade.automatic.kind_trials import DEAD_TIMES, KindTrials, percent, try_kinds
from islands.facade.library_fit import CERTIFICATES, LibraryFit
from islands.facade.trials.library import TrialLibrary
from islands.progress import Steps, StoppedError
from islands.records.dataset import Dataset
from islands.records.inspection.rest import check_rest
from islands.rounding import RESOLUTION
from islands.validation.assessment import Assessment, average_errors
from islands.validation.recommendation import describe_exclusion, list_rivals, measure_size, recommend

#: Largest error of hysteresis relative to the least if the output rests while the inputs rest, because its
#: models keep that property.
_CLOSE = 1.25

NO_DEAD_TIME = "No dead time beyond the lags of the library was found."

#: Name of the step that compares the fits of the kinds.
CHOICE = "choice of the kind of record"

#: Fits the library of a kind with the dead times of the trials.
FitKind = Callable[[TrialLibrary], LibraryFit]


class StoppedChoiceError(StoppedError):
    """The choice was stopped after the fit of one kind or more.

    Attributes
    ----------
    found : SearchResult
        Result of the kind with the least error on the validation data.
    """

    def __init__(self, step: str, found: SearchResult) -> None:
        super().__init__(step)
        self.found = found


@dataclass(frozen=True, slots=True)
class Choice:
    """Kind of record and dead times that the preset ``auto`` chose.

    Attributes
    ----------
    kind : str
        An entry of ``KINDS``.
    delays : tuple of int
        Dead time of each input in samples of the record; empty if there is none.
    reasons : tuple of str
        What was chosen and why, in two sentences.
    errors : mapping
        Free-run RMSE on the validation data of the recommended model of each kind that was compared there,
        as a fraction of the output range of the estimation data, at least `RESOLUTION`. If a model describes
        means of samples, the errors of all are those of means of the same length. A kind is missing if it has
        no model with a finite error.
    trials : mapping
        The same of small models on held-out parts of the estimation data.
    """

    kind: str
    delays: tuple[int, ...]
    reasons: tuple[str, ...]
    errors: Mapping[str, float]
    trials: Mapping[str, float]

    def to_document(self) -> dict[str, Any]:
        """Return the choice as JSON values."""
        return {
            "kind": self.kind,
            "delays": list(self.delays),
            "reasons": list(self.reasons),
            "errors": dict(self.errors),
            "trials": dict(self.trials),
        }


def choice_from_document(document: Mapping[str, Any]) -> Choice:
    """Return a choice from its JSON values.

    Raises
    ------
    SettingsError
        A value is missing or of another type.
    """
    try:
        return Choice(
            str(document["kind"]),
            tuple(map(int, document["delays"])),
            tuple(map(str, document["reasons"])),
            _read_errors(document["errors"]),
            _read_errors(document["trials"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SettingsError(
            f"the stored choice of a preset is damaged ({error!r}): start a new run"
        ) from error


def _read_errors(document: Mapping[str, Any]) -> Mapping[str, float]:
    return MappingProxyType({str(kind): float(error) for kind, error in document.items()})


def choose_kind(
    record: Dataset,
    libraries: Mapping[str, TrialLibrary],
    delays: Sequence[int] | None,
    fit_kind: FitKind,
    steps: Steps,
) -> tuple[Choice, Mapping[str, LibraryFit]]:
    """Choose the kind of a record.

    The recommended models with terms of the kinds are compared as `recommend` compares the models of a
    search: the simplest with as much evidence as the best counts, of equal sizes that of the first kind.
    Hysteresis is chosen within 25 % of the least error if the output rests while the inputs rest. If dead
    times were estimated, models of the chosen kind without them are compared with those that have them in
    the same way.

    Parameters
    ----------
    record : Dataset
        Estimation data without missing values.
    libraries : mapping
        Library and constraints of each kind that may be chosen, the simplest first.
    delays : sequence of int or None
        Dead times; None estimates them.
    fit_kind : callable
        Fits a library to the data; it is called for every kind that the trials do not exclude.
    steps : Steps

    Raises
    ------
    StoppedError
        A stop is requested. If a kind was fitted before, the error is a `StoppedChoiceError`.

    Returns
    -------
    tuple of Choice and mapping
        The choice, and the fits of the kinds that were compared.
    """
    libraries = _drop_repeated(libraries)
    if not record.output_range > 0.0:
        *_, kind = libraries
        sentence = f"{_describe(libraries[kind], kind)}, because the output is constant."
        nothing: Mapping[str, float] = MappingProxyType({})
        return Choice(kind, tuple(delays or ()), (sentence, NO_DEAD_TIME), nothing, nothing), {}
    trials = try_kinds(record, libraries, delays, steps)
    promising = [kind for kind in trials.promising if isfinite(trials.errors[kind])]
    # One kind alone needs no comparison.
    fitted = {kind: libraries[kind].with_delays(trials.delays) for kind in promising[len(promising) == 1 :]}
    fits = _fit_each(fitted, {}, fit_kind, steps)
    bounded = {kind: each for kind, each in fits.items() if _is_bounded(each.recommended_equation)}
    compared, errors, count = _measure_alike(record, bounded)
    kind, reason = _select_kind(record, libraries, trials, compared, errors, count)
    failure = steps.not_computed.get(DEAD_TIMES)
    used, sentence = trials.delays, f"Dead times are not computed: {failure}." if failure else NO_DEAD_TIME
    if delays is not None:
        sentence = f"The dead times are as given: {list(used)}."
    elif used:
        used, sentence = _compare_delays(record, libraries[kind], kind, used, fits, fit_kind, steps)
    choice = Choice(
        kind,
        used,
        (f"{_describe(libraries[kind], kind)}, {reason}.", sentence),
        MappingProxyType(errors),
        MappingProxyType({kind: error for kind, error in trials.errors.items() if isfinite(error)}),
    )
    return choice, fits


def _compare_delays(
    record: Dataset,
    library: TrialLibrary,
    kind: str,
    delays: tuple[int, ...],
    fits: dict[str, LibraryFit],
    fit_kind: FitKind,
    steps: Steps,
) -> tuple[tuple[int, ...], str]:
    """Return the estimated dead times, or none, and why; the fit with them becomes that of the kind."""
    without = f"{kind} without dead time"
    libraries = {without: library, kind: library.with_delays(delays)}
    tried = _fit_each(libraries, fits, fit_kind, steps)
    bounded = {
        name: tried[name]
        for name in libraries
        if name in tried and _is_bounded(tried[name].recommended_equation)
    }
    best, reason = kind, "no model has a finite error without it"
    if bounded:
        best, reason = _recommend_kind(*_measure_alike(record, bounded))
    if best in tried:
        fits[kind] = tried[best]
    verb = "is added to the lags" if best == kind else "is not used"
    samples = ", ".join(map(str, delays))
    return libraries[best].delays, f"A dead time of {samples} samples {verb}, because {reason}."


def _measure_alike(
    record: Dataset, fits: Mapping[str, LibraryFit]
) -> tuple[dict[str, Assessment], dict[str, float], int]:
    """Return the recommended equations of fits and their errors in means of equal length, and that length."""
    count = lcm(*(each.average for each in fits.values()))
    models = {
        name: average_errors(each.recommended_equation, count // each.average) for name, each in fits.items()
    }
    return models, {name: measure_share(model, record) for name, model in models.items()}, count


def _drop_repeated(libraries: Mapping[str, TrialLibrary]) -> Mapping[str, TrialLibrary]:
    """Return the first kind of each library: settings of the user may give the same one to several kinds."""
    first = {library: kind for kind, library in reversed(list(libraries.items()))}
    return {kind: library for kind, library in libraries.items() if first[library] == kind}


def _fit_each(
    libraries: Mapping[str, TrialLibrary], fits: Mapping[str, LibraryFit], fit_kind: FitKind, steps: Steps
) -> dict[str, LibraryFit]:
    """Return the known fits and those of further libraries that have a model."""
    fits = dict(fits)
    missing = [name for name in libraries if name not in fits]
    for place, name in enumerate(missing):
        try:
            steps(f"preset auto: fit of {name}", None)
            fits[name] = fit_kind(libraries[name])
            if fits[name].steps.left_out:
                raise StoppedError(f"preset auto: fit of {name}")
        except StoppedError as stopped:
            if not fits:
                raise
            left_out = [f"fit of {each}" for each in missing[place:] if each not in fits]
            found = [each.incomplete for each in fits.values()]
            raise StoppedChoiceError(stopped.step, _take_best(found, left_out)) from stopped
        except (SettingsError, RecordError, ModelError):
            continue  # Another library may have a model. If none has, the search reports what is wrong.
    return fits


def _take_best(results: Sequence[SearchResult], missing: Sequence[str]) -> SearchResult:
    """Return the result with the least error on the validation data, with the steps that were left out."""
    left_out = dict.fromkeys([each for found in results for each in found.search.left_out])
    count = lcm(*(each.average for each in results))

    def measure(result: SearchResult) -> float:
        return average_errors(result.recommended, count // result.average).validation_error

    best = min(results, key=measure)
    search = replace(
        best.search, ended_by="stopped", left_out=(*left_out, *missing, CHOICE, CERTIFICATES, BANDS)
    )
    return replace(best, search=search)


def _is_bounded(model: Assessment) -> bool:
    """Return whether the free run of a model on the validation data does not diverge."""
    return bool(model.outcomes["validation"]["free_run"])


def measure_share(model: Assessment, record: Dataset) -> float:
    """Return the free-run RMSE on the validation data as a fraction of the output range of a record.

    It is at least `RESOLUTION`.
    """
    return max(model.validation_error / record.output_range, RESOLUTION)


def _select_kind(
    record: Dataset,
    libraries: Mapping[str, TrialLibrary],
    trials: KindTrials,
    compared: Mapping[str, Assessment],
    errors: Mapping[str, float],
    count: int,
) -> tuple[str, str]:
    """Return the kind and the reason; the errors are those of means of ``count`` samples."""
    if not compared:
        first = trials.promising[0]
        if not isfinite(trials.errors[first]):
            return first, "because the record is too short for a comparison"
        return first, (
            "because its free-run RMSE on held-out parts of the estimation data is "
            f"{percent(trials.errors[first])} of the output range of these data"
            f"{list_others(trials.errors, first)}"
        )
    constrained = [each for each in compared if constraint(libraries[each].constraints).sums]
    least = min(errors.values())
    close = [each for each in constrained if errors[each] <= _CLOSE * least]
    if close and check_rest(record).value:
        return close[0], (
            f"because the output rests while the inputs rest, and the free-run RMSE of its recommended "
            f"model on the validation data{_name_means(count)} is {percent(errors[close[0]])} of the output "
            f"range of the estimation data{list_others(errors, close[0])}"
        )
    kind, reason = _recommend_kind(compared, errors, count)
    return kind, f"because {reason}"


def _recommend_kind(
    compared: Mapping[str, Assessment], errors: Mapping[str, float], count: int
) -> tuple[str, str]:
    """Return which of some models is recommended, and why; the errors are those of means of samples."""
    kinds, models = list(compared), list(compared.values())
    sizes = [measure_size(each.model) for each in models]
    best = recommend(sizes, models, False)
    kind = kinds[best.rank - 1]
    is_least = errors[kind] == min(errors.values()) or best.rank == best.reference
    smallest = "" if is_least else ", the simplest with as much evidence,"
    left_out = [
        f"{' and '.join(kinds[rank - 1] for rank in each.ranks)} {describe_exclusion(each, models)}"
        for each in list_rivals(best, sizes, models)
    ]
    return kind, (
        f"the free-run RMSE of its recommended model{smallest} on the validation data{_name_means(count)} is "
        f"{percent(errors[kind])} of the output range of the estimation data{list_others(errors, kind)}"
        f"{'; left out: ' + ' and '.join(left_out) if left_out else ''}"
    )


def _name_means(count: int) -> str:
    return f", in means of {count} samples of the record," if count > 1 else ""


def list_others(errors: Mapping[str, float], kind: str) -> str:
    """Return the errors of the other kinds; equal digits are stated as such."""
    written = {each: percent(error) for each, error in errors.items()}
    others = [
        f"{'as much' if error == written[kind] else error} for {each}"
        for each, error in written.items()
        if each != kind
    ]
    return f", compared with {', '.join(others)}" if others else ""


def _describe(library: TrialLibrary, kind: str) -> str:
    return (
        f"Preset auto chose {kind} (library {library.name} of degree {library.degree} with lags up to "
        f"{library.lags}, constraints {library.constraints})"
    )
