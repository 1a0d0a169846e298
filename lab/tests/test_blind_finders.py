"""A diagnosis with a wrong catalogue fails the checks of `test_hidden`."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from acceptance import test_hidden as checks
from islands.effects.catalogue import CATALOGUE
from lab.diagnosis import trial as trials_module
from lab.diagnosis.trial import Trial, TrialOutcome

Finder = Callable[[Trial], TrialOutcome]


#: Effects on the output whose names are exchanged.
EXCHANGED = ("offset", "linear-drift", "jump", "thermal-drift")


@pytest.mark.parametrize("name", ["jump", "thermal-drift"])
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


def test_empty_catalogue_fails_the_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials_module, "diagnose", partial(trials_module.diagnose, catalogue=()))
    with pytest.raises(AssertionError):
        checks.test_injected_effect_is_named_in_a_short_record("jump")
