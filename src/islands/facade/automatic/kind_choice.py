"""Choice of the preset ``auto``: kind of record and dead times.

Trials on the estimation data exclude kinds (see `try_kinds`). The others are fitted to the same data. Their
recommended models are compared on the validation data, and the models of all of them form one front.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from math import inf, isfinite
from types import MappingProxyType

from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.search_result import ResultCallback, SearchResult, take_recommended
from islands.facade.automatic.choice import Choice
from islands.facade.automatic.kind_trials import DEAD_TIMES, KindTrials, find_delays, percent, try_kinds
from islands.facade.fit_settings import FitSettings
from islands.facade.front import Front, StoppedFitError, find_linear_result, list_simple
from islands.facade.library_fit import LibraryFit, fit_library
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.prepared_data import PreparedData, prepare_data
from islands.facade.trials.static_selection import STATIC, find_static
from islands.models.form import is_static, name_form
from islands.progress import Steps, StoppedError
from islands.records.averaging import AUTO as AUTO_AVERAGE
from islands.records.dataset import Dataset
from islands.records.input_lead import AUTO as AUTO_FEEDTHROUGH
from islands.records.inspection.rest import check_rest
from islands.records.split import Split
from islands.rounding import RESOLUTION
from islands.validation.assessment import Assessment
from islands.validation.recommendation import recommend
from islands.validation.recommendation_reasons import describe_exclusion, list_rivals

#: Largest error of hysteresis on all data, relative to the least, if the output rests while the inputs rest,
#: because its models keep that property.
_CLOSE = 1.25

NO_DEAD_TIME = "No dead time beyond the lags of the library was found."

#: Name of the step that compares the fits of the kinds.
CHOICE = "choice of the kind of record"


def choose_kind(
    record: Dataset,
    split: Split,
    libraries: Mapping[str, TrialLibrary],
    settings: FitSettings,
    least: int,
    seed: int,
    steps: Steps,
    on_front: ResultCallback | None,
) -> tuple[Choice, Front | None]:
    """Choose the kind of a record.

    The recommended models with terms of the kinds are compared as `recommend` compares the models of a
    search: the simplest with as much evidence as the best counts, of equal sizes that of the first kind.
    Hysteresis is chosen within 25 % of the least error if the output rests while the inputs rest. If dead
    times were estimated, models of the chosen kind without them are compared with those that have them in
    the same way.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user.
    split : Split
        Estimation data and validation data at the rate of the record, without missing values.
    libraries : mapping
        Library and constraints of each kind that may be chosen, the simplest first.
    settings : FitSettings
        Settings of the fits. Without dead times, these are estimated.
    least : int
        Fewest samples of a segment that permit a prediction without dead times.
    seed : int
        Stored in the results.
    steps : Steps
    on_front : callable, optional
        Called with the result of all models so far: of the linear model, and after every fit.

    Raises
    ------
    StoppedError
        A stop is requested. If there is a model, the error is a `StoppedFitError`.

    Returns
    -------
    tuple of Choice and Front
        The choice without models, and the models of the kinds that were fitted; None if no fit has one.
    """
    libraries = _drop_repeated(libraries)
    # Models of hysteresis keep a property that no simple model has.
    free = [each for each in libraries.values() if not _is_constrained(each)]
    linear = find_linear_result(record, split, free[0], settings, seed, steps) if free else None
    if linear and on_front:
        on_front(linear)
    delays: Sequence[Sequence[int]] | None = None if settings.delays is None else (settings.delays,)
    if delays is None and linear:
        delays = (), find_delays(linear.models[0].model)
    try:
        return _choose_kind(record, split, libraries, settings, delays, least, seed, steps, on_front)
    except StoppedFitError:
        raise
    except StoppedError as stopped:
        if linear is None:
            raise
        raise StoppedFitError(stopped.step, linear, [CHOICE]) from stopped


def _choose_kind(
    record: Dataset,
    split: Split,
    libraries: Mapping[str, TrialLibrary],
    settings: FitSettings,
    delays: Sequence[Sequence[int]] | None,
    least: int,
    seed: int,
    steps: Steps,
    on_front: ResultCallback | None,
) -> tuple[Choice, Front | None]:
    """Choose the kind of a record; see `choose_kind`."""
    estimation = split.estimation
    if estimation.output_range > 0.0:
        trials = try_kinds(estimation, libraries, delays, steps)
    else:
        trials = KindTrials(tuple(settings.delays or ()), {list(libraries)[-1]: inf})
    promising = [kind for kind in trials.promising if isfinite(trials.errors[kind])]
    promising = promising or list(trials.promising[:1])
    late = {kind: library.with_delays(trials.delays) for kind, library in libraries.items()}
    least += max(trials.delays, default=0)
    first = late[min(promising, key=trials.errors.__getitem__)]
    data = _find_static_data(split, settings, first, steps)
    data = data or prepare_data(split, settings.average, settings.feedthrough, first, least, steps)
    free = [kind for kind, library in late.items() if not _is_constrained(library)]
    simple = list_simple(data, late[free[0]], settings, steps) if free else []
    fits = _KindFits(record, data, simple, settings, seed, steps, on_front)
    fits.add({kind: late[kind] for kind in promising})
    if _find_least(simple) < _find_least(fits.bounded.values()) and not fits.known.intersection(free):
        rival = min(free, key=trials.errors.__getitem__)
        fits.add({rival: late[rival]})
    errors = fits.measure_errors()
    kind, reason = _select_kind(data.split.estimation, libraries, trials, fits.bounded, errors, simple)
    chosen, used, sentence = kind, trials.delays, _describe_delays(trials, settings, steps)
    if used and settings.delays is None:
        without = f"{kind} without dead time"
        fits.add({without: libraries[kind]})
        chosen, sentence = _compare_delays(fits, kind, without, used)
        used = () if chosen == without else used
    choice = Choice(
        kind,
        used,
        (f"{_describe(libraries[kind], kind)}, {reason}.", sentence),
        MappingProxyType(errors),
        MappingProxyType({kind: error for kind, error in trials.errors.items() if isfinite(error)}),
        MappingProxyType(data.to_document()),
    )
    return choice, fits.make_front(chosen)


def _find_static_data(
    split: Split, settings: FitSettings, library: TrialLibrary, steps: Steps
) -> PreparedData | None:
    """Return the data of a static record, at its rate; None of another one, or if the settings say how."""
    chosen = settings.average, settings.feedthrough, settings.delays
    if chosen != (AUTO_AVERAGE, AUTO_FEEDTHROUGH, None):
        return None
    return steps.attempt(STATIC, partial(find_static, split, library, steps))


def _is_constrained(library: TrialLibrary) -> bool:
    """Return whether the models of a library are those of hysteresis."""
    return bool(constraint(library.constraints).sums)


def _describe_delays(trials: KindTrials, settings: FitSettings, steps: Steps) -> str:
    """State the dead times that are given, or that none is known."""
    if settings.delays is not None:
        return f"The dead times are as given: {list(trials.delays)}."
    failure = steps.not_computed.get(DEAD_TIMES)
    return f"Dead times are not computed: {failure}." if failure else NO_DEAD_TIME


class _KindFits:
    """Fits of the libraries of several kinds to the same data.

    Parameters
    ----------
    record : Dataset
        Record as passed by the user.
    data : PreparedData
    simple : sequence of Assessment
        Simplest models of the same data.
    settings : FitSettings
    seed : int
    steps : Steps
    on_front : callable, optional
        Called with the result of all models after every fit.
    """

    def __init__(
        self,
        record: Dataset,
        data: PreparedData,
        simple: Sequence[Assessment],
        settings: FitSettings,
        seed: int,
        steps: Steps,
        on_front: ResultCallback | None,
    ) -> None:
        self._record, self._data, self._simple = record, data, tuple(simple)
        self._settings, self._seed, self._steps = settings, seed, steps
        self._on_front, self._fits = on_front, dict[str, LibraryFit]()

    @property
    def known(self) -> frozenset[str]:
        """Names of the fits."""
        return frozenset(self._fits)

    @property
    def bounded(self) -> dict[str, Assessment]:
        """Recommended equation of each fit whose free run on the validation data does not diverge."""
        models = {name: fit.found.recommended for name, fit in self._fits.items()}
        return {name: each for name, each in models.items() if each.outcomes["validation"]["free_run"]}

    def measure_errors(self) -> dict[str, float]:
        """Return the error of each bounded equation; see `measure_share`."""
        return {name: measure_share(each, self._data.split.estimation) for name, each in self.bounded.items()}

    def add(self, libraries: Mapping[str, TrialLibrary]) -> None:
        """Fit further libraries; one that has no model is left out.

        Raises
        ------
        StoppedError
            As of `choose_kind`.
        """
        for place, (name, library) in enumerate(libraries.items()):
            step = f"preset auto: fit of {name}"
            try:
                self._steps(step, None)
                fit = fit_library(self._record, self._data, library, self._settings, self._seed, self._steps)
                self._fits[name] = fit
                if self._steps.left_out:
                    raise StoppedError(step)
                if self._on_front:
                    self._steps.call(self._on_front, self._take_found())
            except StoppedError as stopped:
                if not self._fits:
                    raise
                missing = [f"fit of {each}" for each in list(libraries)[place:] if each not in self._fits]
                raise StoppedFitError(stopped.step, self._take_found(), [*missing, CHOICE]) from stopped
            except (SettingsError, RecordError, ModelError):
                continue  # Another library may have a model. If none has, the search reports what is wrong.

    def make_front(self, name: str) -> Front | None:
        """Return the front of a fit with those whose models meet the same constraints."""
        fit = self._fits.get(name)
        if fit is None:
            return None
        constraints = fit.found.settings["constraints"]
        others = [
            each
            for each in self._fits.values()
            if each is not fit and each.found.settings["constraints"] == constraints
        ]
        simple = () if constraint(constraints).sums else self._simple
        return Front(fit, tuple(others), simple)

    def _take_found(self) -> SearchResult:
        """Return the result of the fits so far."""
        best = min(self._fits, key=lambda name: self._fits[name].found.recommended.validation_error)
        front = self.make_front(best)
        assert front is not None
        return front.incomplete


def _compare_delays(fits: _KindFits, kind: str, without: str, delays: tuple[int, ...]) -> tuple[str, str]:
    """Return which of the fits with and without dead times is chosen, and why."""
    bounded, errors = fits.bounded, fits.measure_errors()
    compared = {name: bounded[name] for name in (without, kind) if name in bounded}
    best, reason = kind, "no model has a finite error without it"
    if compared:
        best, reason = recommend_kind(compared, {name: errors[name] for name in compared})
    verb = "is added to the lags" if best == kind else "is not used"
    samples = ", ".join(map(str, delays))
    return best, f"A dead time of {samples} samples {verb}, because {reason}."


def _drop_repeated(libraries: Mapping[str, TrialLibrary]) -> Mapping[str, TrialLibrary]:
    """Return the first kind of each library: settings of the user may give the same one to several kinds."""
    first = {library: kind for kind, library in reversed(list(libraries.items()))}
    return {kind: library for kind, library in libraries.items() if first[library] == kind}


def measure_share(model: Assessment, record: Dataset) -> float:
    """Return the free-run RMSE on the validation data as a fraction of the output range of a record.

    It is at least `RESOLUTION`.
    """
    return max(model.validation_error / (record.output_range or 1.0), RESOLUTION)


def _find_least(models: Iterable[Assessment]) -> float:
    """Return the least mean square of the free runs on all data."""
    return min((each.mean_square for each in models), default=inf)


def _select_kind(
    record: Dataset,
    libraries: Mapping[str, TrialLibrary],
    trials: KindTrials,
    compared: Mapping[str, Assessment],
    errors: Mapping[str, float],
    simple: Sequence[Assessment],
) -> tuple[str, str]:
    """Return the kind and the reason; the least error of the simplest models limits that of hysteresis.

    A static model keeps the property of hysteresis as well. A record whose recommended model is one of the
    simplest is of the first kind.
    """
    if not record.output_range > 0.0:
        return trials.promising[0], "because the output is constant"
    if len(compared) < 2:
        first = next(iter(compared), trials.promising[0])
        if not isfinite(trials.errors[first]):
            return first, "because the record is too short for a comparison"
        return first, (
            "because its free-run RMSE on held-out parts of the estimation data is "
            f"{percent(trials.errors[first])} of the output range of these data"
            f"{list_others(trials.errors, first)}"
        )
    constrained = [each for each in compared if _is_constrained(libraries[each])]
    limit = _CLOSE**2 * _find_least([*compared.values(), *simple])
    close = [each for each in constrained if compared[each].mean_square <= limit]
    rests = bool(close) and check_rest(record).value
    if rests and not is_static(take_recommended([compared[close[0]], *simple]).model):
        return close[0], (
            f"because the output rests while the inputs rest, and the free-run RMSE of its recommended "
            f"model on the validation data is {percent(errors[close[0]])} of the output "
            f"range of the estimation data{list_others(errors, close[0])}"
        )
    others = {kind: each for kind, each in compared.items() if kind in close or kind not in constrained}
    simplest = next((kind for kind in others if kind not in constrained), None)
    if simplest is not None:
        recommended = take_recommended([*simple, *others.values()])
        if recommended in simple:
            return (
                simplest,
                f"because a model of the form {name_form(recommended.model)} has the most evidence",
            )
    kind, reason = recommend_kind(others or compared, errors)
    return kind, f"because {reason}"


def recommend_kind(compared: Mapping[str, Assessment], errors: Mapping[str, float]) -> tuple[str, str]:
    """Return which of some models of kinds is recommended, and why.

    Parameters
    ----------
    compared : mapping
        A model of each kind, with a bounded free run.
    errors : mapping
        Their errors; see `measure_share`.
    """
    kinds, models = list(compared), list(compared.values())
    best = recommend(models, False)
    kind = kinds[best.rank - 1]
    is_least = errors[kind] == min(errors.values()) or best.rank == best.reference
    smallest = "" if is_least else ", the simplest with as much evidence,"
    left_out = [
        f"{' and '.join(kinds[rank - 1] for rank in each.ranks)} {describe_exclusion(each, models)}"
        for each in list_rivals(best, models)
    ]
    return kind, (
        f"the free-run RMSE of its recommended model{smallest} on the validation data is "
        f"{percent(errors[kind])} of the output range of the estimation data{list_others(errors, kind)}"
        f"{'; left out: ' + ' and '.join(left_out) if left_out else ''}"
    )


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
