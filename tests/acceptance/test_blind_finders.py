"""A finder that always says the same fails the tests that hide something: they are tests.

Each mutant says what it says of whatever is asked; the checks of `test_hidden` are run on it.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import pytest
from _pytest.mark import ParameterSet

from acceptance import test_hidden as checks
from islands.discrepancy.effects import CATALOGUE
from islands.performance.trials import trial as trials_module
from islands.performance.trials.injection.piezo import PIEZO
from islands.performance.trials.trial import Trial, TrialOutcome

Finder = Callable[[Trial], TrialOutcome]


def said(trial: Trial, *names: str, verdict: str | None = None) -> TrialOutcome:
    """Return an outcome with given names; of noise it says what there is."""
    noise = ("coloured-noise",) if trial.pole else ()
    found = verdict or ("named" if names or noise else "nothing")
    return TrialOutcome(
        trial, 1.0, found, names, noise, tuple(() for _ in names), names[:3], 1.0 if names else 0.0
    )


def knowing(trial: Trial) -> TrialOutcome:
    """Say what is hidden, and "unknown" where it has no name: no check may fail on that."""
    if any(name in PIEZO.unknown for name in trial.effects):
        return said(trial, verdict="unknown")
    return said(trial, *trial.effects)


def silent(trial: Trial) -> TrialOutcome:
    return said(trial)


def always(name: str) -> Finder:
    return lambda trial: said(trial, name)


def permuted(trial: Trial) -> TrialOutcome:
    """Call everything by the next name of the list."""
    known = list(PIEZO.known)
    following = dict(zip(known, known[1:] + known[:1], strict=True))
    right = knowing(trial)
    return replace(right, named=tuple(following.get(name, known[0]) for name in right.named))


def vague(trial: Trial) -> TrialOutcome:
    """Name what is hidden, and say that it cannot be told from anything else."""
    right = knowing(trial)
    return replace(right, equivalents=tuple(tuple(PIEZO.known) for _ in right.named))


def unsure(trial: Trial) -> TrialOutcome:
    return said(trial, verdict="unknown")


def cases() -> Iterator[tuple[str, Callable[[], None]]]:
    """Return every check of `test_hidden` with every argument that it is run with."""
    for title, check in vars(checks).items():
        if title.startswith("test_"):
            for asked in arguments(check):
                yield f"{title}{list(asked.values())}", partial(check, **asked)


def arguments(check: Callable[..., None]) -> Iterator[dict[str, object]]:
    """Return what the marks of a check say that it is run with, at whatever level."""
    choices = []
    for mark in getattr(check, "pytestmark", []):
        if mark.name != "parametrize":
            continue
        names, values = mark.args
        values = [_plain(value) for value in values]
        if isinstance(names, str):
            choices.append([{names: value} for value in values])
        else:
            choices.append([dict(zip(names, each, strict=True)) for each in values])
    for choice in product(*choices):
        yield {name: value for each in choice for name, value in each.items()}


def _plain(value: object) -> object:
    """Return a case of a check without the marks that say its level."""
    if not isinstance(value, ParameterSet):
        return value
    return value.values[0] if len(value.values) == 1 else value.values


CASES = dict(cases())


def failures(finder: Finder, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return the checks that fail with a finder in the place of ours."""
    monkeypatch.setattr(checks, "run_trial", finder)
    failed = set()
    for name, check in CASES.items():
        try:
            check()
        except (AssertionError, IndexError):
            failed.add(name)
    return failed


@pytest.fixture(scope="module")
def hidden() -> dict[str, tuple[str, ...]]:
    """Return what every check hides."""
    seen: list[Trial] = []

    def watching(trial: Trial) -> TrialOutcome:
        seen.append(trial)
        return knowing(trial)

    with pytest.MonkeyPatch.context() as monkeypatch:
        assert failures(watching, monkeypatch) == set()
    return {name: trial.effects for name, trial in zip(CASES, seen, strict=True)}


def test_everything_is_hidden_somewhere(hidden: dict[str, tuple[str, ...]]) -> None:
    assert {(name,) for name in PIEZO.known} < set(hidden.values())


def test_a_silent_finder_fails_all_but_the_clean_records(
    hidden: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert failures(silent, monkeypatch) == {case for case, effects in hidden.items() if effects}


@pytest.mark.parametrize("name", PIEZO.known)
def test_a_finder_that_always_says_the_same_fails_nearly_everywhere(
    name: str, hidden: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = failures(always(name), monkeypatch)
    assert failed == {case for case, effects in hidden.items() if effects != (name,)}


def test_permuted_names_fail_wherever_there_are_names(
    hidden: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {case for case, effects in hidden.items() if effects and not set(effects) & set(PIEZO.unknown)}
    assert failures(permuted, monkeypatch) == named


def test_a_finder_that_tells_nothing_apart_fails_wherever_there_are_names(
    hidden: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {case for case, effects in hidden.items() if effects and not set(effects) & set(PIEZO.unknown)}
    assert failures(vague, monkeypatch) == named


def test_a_finder_that_never_names_anything_fails_wherever_there_are_names(
    hidden: dict[str, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    nameless = {case for case, effects in hidden.items() if set(effects) & set(PIEZO.unknown)}
    assert failures(unsure, monkeypatch) == set(CASES) - nameless


#: Effects that act one after the other on the output: their names may be exchanged.
EXCHANGED = ("offset", "linear-drift", "jump", "thermal-drift")


@pytest.mark.ci
@pytest.mark.parametrize("name", ["jump", "thermal-drift"])
def test_with_names_exchanged_in_the_catalogue_the_true_finder_fails(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The finder's effects are changed here, not its words; with the right ones `test_hidden` passes."""
    wrong = dict(CATALOGUE)
    for one, other in zip(EXCHANGED, EXCHANGED[1:] + EXCHANGED[:1], strict=True):
        wrong[one] = replace(CATALOGUE[other], name=one)
    monkeypatch.setattr(
        trials_module, "diagnose", partial(trials_module.diagnose, catalogue=tuple(wrong.values()))
    )
    with pytest.raises(AssertionError):
        checks.test_injected_effect_is_named_in_a_short_record(name)


def test_without_effects_in_the_catalogue_the_true_finder_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials_module, "diagnose", partial(trials_module.diagnose, catalogue=()))
    with pytest.raises(AssertionError):
        checks.test_injected_effect_is_named_in_a_short_record("jump")
