"""Mutants of the diagnosis, for example with a constant answer, fail the checks of `test_hidden`."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import pytest
from _pytest.mark import ParameterSet

from acceptance import test_hidden as checks
from islands.effects.catalogue import CATALOGUE
from islands_measurements.detection import trial as trials_module
from islands_measurements.detection.injection.piezo import PIEZO
from islands_measurements.detection.trial import Trial, TrialOutcome

Finder = Callable[[Trial], TrialOutcome]


def make_outcome(trial: Trial, *names: str, verdict: str | None = None) -> TrialOutcome:
    """Return an outcome with given names and the true noise."""
    noise = ("coloured-noise",) if trial.noise == "ar" else ()
    found = verdict or ("named" if names else "nothing")
    return TrialOutcome(
        trial, 1.0, found, names, noise, tuple(() for _ in names), names[:3], 1.0 if names else 0.0
    )


def perfect(trial: Trial) -> TrialOutcome:
    """Name the injected effects, or return "unknown" if they are not in the catalogue: all checks pass."""
    if any(name in PIEZO.unknown for name in trial.effects):
        return make_outcome(trial, verdict="unknown")
    return make_outcome(trial, *trial.effects)


def silent(trial: Trial) -> TrialOutcome:
    return make_outcome(trial)


def always(name: str) -> Finder:
    return lambda trial: make_outcome(trial, name)


def permuted(trial: Trial) -> TrialOutcome:
    """Replace each name by the next one of the list."""
    known = list(PIEZO.known)
    following = dict(zip(known, known[1:] + known[:1], strict=True))
    right = perfect(trial)
    return replace(right, named=tuple(following.get(name, known[0]) for name in right.named))


def vague(trial: Trial) -> TrialOutcome:
    """Name the injected effects, each equivalent to all others."""
    right = perfect(trial)
    return replace(right, equivalents=tuple(tuple(PIEZO.known) for _ in right.named))


def unsure(trial: Trial) -> TrialOutcome:
    return make_outcome(trial, verdict="unknown")


def cases() -> Iterator[tuple[str, Callable[[], None]]]:
    """Return all checks of `test_hidden` with all their arguments."""
    for title, check in vars(checks).items():
        if title.startswith("test_"):
            for given in arguments(check):
                yield f"{title}{list(given.values())}", partial(check, **given)


def arguments(check: Callable[..., None]) -> Iterator[dict[str, object]]:
    """Return the parametrised arguments of a check at all test levels."""
    choices = []
    for mark in getattr(check, "pytestmark", []):
        if mark.name != "parametrize":
            continue
        names, values = mark.args
        values = [_strip_marks(value) for value in values]
        if isinstance(names, str):
            choices.append([{names: value} for value in values])
        else:
            choices.append([dict(zip(names, each, strict=True)) for each in values])
    for choice in product(*choices):
        yield {name: value for each in choice for name, value in each.items()}


def _strip_marks(value: object) -> object:
    """Return a parameter of a check without its level mark."""
    if not isinstance(value, ParameterSet):
        return value
    return value.values[0] if len(value.values) == 1 else value.values


CASES = dict(cases())


def failures(finder: Finder, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return the checks that fail with another finder."""
    monkeypatch.setattr(checks, "run_trial", finder)
    failed = set()
    for name, check in CASES.items():
        try:
            check()
        except (AssertionError, IndexError):
            failed.add(name)
    return failed


@pytest.fixture(scope="module")
def injected() -> dict[str, tuple[str, ...]]:
    """Return the effects that each check injects."""
    seen: list[Trial] = []

    def record(trial: Trial) -> TrialOutcome:
        seen.append(trial)
        return perfect(trial)

    with pytest.MonkeyPatch.context() as monkeypatch:
        assert failures(record, monkeypatch) == set()
    return {name: trial.effects for name, trial in zip(CASES, seen, strict=True)}


def test_all_known_effects_are_injected_by_some_check(injected: dict[str, tuple[str, ...]]) -> None:
    assert {(name,) for name in PIEZO.known} < set(injected.values())


def test_silent_finder_passes_clean_records_only(
    injected: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert failures(silent, monkeypatch) == {case for case, effects in injected.items() if effects}


@pytest.mark.parametrize("name", PIEZO.known)
def test_constant_finder_passes_the_checks_of_its_effect_only(
    name: str, injected: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = failures(always(name), monkeypatch)
    assert failed == {case for case, effects in injected.items() if effects != (name,)}


def test_permuted_names_fail_all_checks_of_names(
    injected: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {case for case, effects in injected.items() if effects and not set(effects) & set(PIEZO.unknown)}
    assert failures(permuted, monkeypatch) == named


def test_indiscriminate_finder_fails_all_checks_of_names(
    injected: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {case for case, effects in injected.items() if effects and not set(effects) & set(PIEZO.unknown)}
    assert failures(vague, monkeypatch) == named


def test_finder_without_names_passes_unknown_causes_only(
    injected: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    nameless = {case for case, effects in injected.items() if set(effects) & set(PIEZO.unknown)}
    assert failures(unsure, monkeypatch) == set(CASES) - nameless


#: Effects on the output whose names are exchanged.
EXCHANGED = ("offset", "linear-drift", "jump", "thermal-drift")


@pytest.mark.ci
@pytest.mark.parametrize("name", ["jump", pytest.param("thermal-drift", marks=pytest.mark.nightly)])
def test_exchanged_names_in_the_catalogue_fail_the_checks(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The effects of the real finder are exchanged, not its answers; with true effects the checks pass."""
    wrong = dict(CATALOGUE)
    for one, other in zip(EXCHANGED, EXCHANGED[1:] + EXCHANGED[:1], strict=True):
        wrong[one] = replace(CATALOGUE[other], name=one)
    monkeypatch.setattr(
        trials_module, "diagnose", partial(trials_module.diagnose, catalogue=tuple(wrong.values()))
    )
    with pytest.raises(AssertionError):
        checks.test_injected_effect_is_named_in_a_short_record(name)


@pytest.mark.ci
def test_empty_catalogue_fails_the_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials_module, "diagnose", partial(trials_module.diagnose, catalogue=()))
    with pytest.raises(AssertionError):
        checks.test_injected_effect_is_named_in_a_short_record("jump")
