"""Choice of the preset ``auto``: kind of record and dead times.

Small models of the library of every kind are compared in free run on held-out parts of the estimation data.
The validation data take no part in the choice, so that they rank the models of the search without bias.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from types import MappingProxyType
from typing import Any

from islands.data.channel_names import parse_channel_name
from islands.data.dataset import Dataset
from islands.data.split import split_data
from islands.errors import SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.input_delays import check_delays
from islands.evolution.presets import AUTO, KINDS, resolve_kinds, with_tuples
from islands.evolution.progress import ProgressCallback, ignore_progress
from islands.facade.automatic.held_out_error import hold_out, measure_library
from islands.facade.automatic.trial_library import TrialLibrary, make_trial_library, take_library
from islands.inspection.dead_time import estimate_dead_time
from islands.inspection.rest import check_rest

#: Errors up to this factor of the least count as equal: the first kind of the table is then chosen.
_EQUAL = 1.05

#: The same for hysteresis if the output rests while the inputs rest, because its models keep that property.
_CLOSE = 1.15

#: Error as a fraction of the output range that is a rounding error.
_ROUNDING = 1e-6

#: Largest error with dead times relative to that without.
_LARGEST_RATIO = 0.9

#: Smallest dead time in samples that is tried. Lags of the library cover shorter ones.
_LEAST_DELAY = 2

#: Terms of the trial models, at most: of all kinds, and of kinds within a factor of the least error.
_TERMS, _MOST_TERMS, _PROMISING = 6, 10, 1.5

#: Kind whose library tells whether dead times reduce the error.
_SIMPLEST = "smooth"


#: Errors on the held-out parts, as fractions of the output range.
_Errors = tuple[float, ...]

_NO_DEAD_TIME = "No dead time beyond the lags of the library was found."


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
        Free-run error of each kind on held-out parts of the estimation data, as a fraction of the output
        range. A kind is missing if no model could be simulated.
    """

    kind: str
    delays: tuple[int, ...]
    reasons: tuple[str, ...]
    errors: Mapping[str, float]

    def to_document(self) -> dict[str, Any]:
        """Return the choice as JSON values."""
        return {
            "kind": self.kind,
            "delays": list(self.delays),
            "reasons": list(self.reasons),
            "errors": dict(self.errors),
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
            MappingProxyType({str(kind): float(error) for kind, error in document["errors"].items()}),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SettingsError(
            f"the stored choice of a preset is damaged ({error!r}): start a new run"
        ) from error


def choose_preset(
    record: Dataset,
    validation: Dataset | float,
    changes: Mapping[str, Any],
    progress: ProgressCallback = ignore_progress,
) -> Choice:
    """Choose the settings of the preset ``auto`` for ``identify``; see `choose_kind`.

    Parameters
    ----------
    record : Dataset
    validation : Dataset or float
        Validation data or fraction. They take no part in the choice.
    changes : mapping
        Settings of the user, which take precedence over the choice.

    Raises
    ------
    SettingsError, RecordError
        As in `islands.identify`.
    """
    changes = with_tuples(changes)
    libraries = {kind: make_trial_library(each) for kind, each in resolve_kinds(changes).items()}
    estimation = split_data(record, validation).estimation
    return choose_kind(estimation, libraries, changes.get("library_delays"), progress)


def choose_library(
    record: Dataset,
    library: str,
    degree: int | None,
    lags: int | None,
    constraints: str | None,
    delays: Sequence[int] | None,
    progress: ProgressCallback = ignore_progress,
) -> tuple[Choice | None, TrialLibrary]:
    """Return the library of ``fit`` and, if its name is ``auto``, the choice for the estimation data.

    Values that are None are chosen, or have the default of the library.

    Raises
    ------
    SettingsError
        The library is unknown, or the constraints or dead times do not suit the record.
    """
    check_delays(delays or ())
    if constraints is not None:
        constraint(constraints).check_inputs(record.inputs)
    if library != AUTO:
        return None, take_library(library, degree, lags, constraints, delays or ())
    kinds = resolve_kinds({} if constraints is None else {"constraints": constraints})
    libraries = {kind: take_library(each.library, degree, lags, constraints) for kind, each in kinds.items()}
    choice = choose_kind(record, libraries, delays, progress)
    return choice, replace(libraries[choice.kind], delays=choice.delays)


def choose_kind(
    record: Dataset,
    libraries: Mapping[str, TrialLibrary],
    delays: Sequence[int] | None = None,
    progress: ProgressCallback = ignore_progress,
) -> Choice:
    """Choose the kind of a record.

    Dead times are estimated and kept if they reduce the error of the simplest library by a tenth. Then the
    kind with the least error is chosen, the simplest unless another one is better on every held-out part.
    Errors that differ by less than 5 % count as equal; hysteresis is also chosen within 15 % of the least if
    the output rests while the inputs rest.

    Parameters
    ----------
    record : Dataset
        Estimation data without missing values.
    libraries : mapping
        Library and constraints of each kind that may be chosen.
    delays : sequence of int, optional
        Dead times; None estimates them.
    progress : callable, optional
        Called with a message and the completed fraction.
    """
    if not record.output_range > 0.0:
        *_, kind = libraries
        sentence = f"{_describe(kind, libraries)}, because the output is constant."
        return Choice(kind, tuple(delays or ()), (sentence, _NO_DEAD_TIME), MappingProxyType({}))
    splits = hold_out(record)
    errors: dict[str, _Errors] = {}

    def measure(kind: str, delays: Sequence[int], terms: int = _TERMS) -> _Errors:
        progress(f"preset auto: trial of {kind} with up to {terms} terms", None)
        found = measure_library(splits, replace(libraries[kind], delays=tuple(delays)), terms)
        return tuple(max(error / record.output_range, _ROUNDING) for error in found)

    simplest = _SIMPLEST if _SIMPLEST in libraries else next(iter(libraries))
    chosen = tuple(delays or ())
    errors[simplest] = measure(simplest, chosen)
    sentence = f"The dead times are as given: {list(chosen)}."
    if delays is None:
        progress("preset auto: dead times", None)
        estimated = _estimate_delays(record)
        sentence = _NO_DEAD_TIME
        if any(estimated):
            delayed = measure(simplest, estimated)
            before, after = _average(errors[simplest]), _average(delayed)
            gain = f"the error of {simplest} models from {_percent(before)} to {_percent(after)}"
            sentence = f"A dead time of {_join(estimated)} samples is not used: it changes {gain}."
            if after <= _LARGEST_RATIO * before:
                chosen, errors[simplest] = estimated, delayed
                sentence = (
                    f"A dead time of {_join(estimated)} samples is added to the lags: it reduces {gain}."
                )
    for kind in libraries:
        if kind != simplest:
            errors[kind] = measure(kind, chosen)
    least = min(map(_average, errors.values()))
    promising = [kind for kind in libraries if _average(errors[kind]) <= _PROMISING * least]
    # A larger library has to be better with larger models, too.
    if len(promising) > 1 and _average(errors[simplest]) > _EQUAL * least:
        for kind in promising:
            errors[kind] = min(errors[kind], measure(kind, chosen, _MOST_TERMS), key=_average)
    kind, reason = _select_kind(record, libraries, errors)
    averages = {name: _average(errors[name]) for name in libraries}
    found = {name: error for name, error in averages.items() if isfinite(error)}
    return Choice(kind, chosen, (reason, sentence), MappingProxyType(found))


def _average(errors: _Errors) -> float:
    """Return the root mean square of the errors on the held-out parts."""
    return float((sum(error**2 for error in errors) / len(errors)) ** 0.5)


def _estimate_delays(record: Dataset) -> tuple[int, ...]:
    """Return by how many samples the response to each input is late; 0 where it is not known to be."""
    late = []
    for place, name in enumerate(record.input_names):
        onset = None if parse_channel_name(name).at_once else estimate_dead_time(record, place).value
        delay = 0 if onset is None else int(onset) - 1
        late.append(delay if delay >= _LEAST_DELAY else 0)
    return tuple(late)


def _select_kind(
    record: Dataset, libraries: Mapping[str, TrialLibrary], parts: Mapping[str, _Errors]
) -> tuple[str, str]:
    """Return the kind and the sentence that gives the reason."""
    errors = {kind: _average(each) for kind, each in parts.items()}
    preferred = [kind for kind in KINDS if kind in libraries]
    simplest = preferred[0]
    if not isfinite(min(errors.values())):
        reason = "because the record is too short for a comparison"
        return simplest, f"{_describe(simplest, libraries)}, {reason}."
    # Another kind has to be better than the simplest one on every part.
    better = [
        kind
        for kind in preferred
        if all(_EQUAL * one <= other for one, other in zip(parts[kind], parts[simplest], strict=True))
    ]
    eligible = [simplest, *better]
    least = min(errors[each] for each in eligible)
    kind = next(each for each in eligible if errors[each] <= _EQUAL * least)
    constrained = [each for each in preferred if constraint(libraries[each].constraints).sums]
    if kind not in constrained:
        close = [each for each in constrained if errors[each] <= _CLOSE * least]
        if close and check_rest(record).value:
            kind = close[0]
            return kind, (
                f"{_describe(kind, libraries)}, because the output rests while the inputs rest, and its "
                f"free-run error on held-out parts of the estimation data, {_percent(errors[kind])} of the "
                f"output range, is close to the least, {_percent(least)}."
            )
    others = [f"{_percent(errors[each])} for {each}" for each in preferred if each != kind]
    against = f", compared with {', '.join(others)}" if others else ""
    return kind, (
        f"{_describe(kind, libraries)}, because its free-run error on held-out parts of the estimation data "
        f"is {_percent(errors[kind])} of the output range{against}."
    )


def _describe(kind: str, libraries: Mapping[str, TrialLibrary]) -> str:
    library = libraries[kind]
    return (
        f"Preset auto chose {kind} (library {library.name} of degree {library.degree} with lags up to "
        f"{library.lags}, constraints {library.constraints})"
    )


def _percent(error: float) -> str:
    return f"{100.0 * error:.3g} %" if isfinite(error) else "no finite error"


def _join(delays: Sequence[int]) -> str:
    return ", ".join(map(str, delays))
