"""The guides and the generated reference of the diagnosis agree with the code: effects and verdicts."""

import re

import pytest

from islands.discrepancy.effects import CATALOGUE, OF_EACH
from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.verdict import Verdict
from support.repository import DOCS

DIAGNOSE = (DOCS / "how-to" / "diagnose-a-simulation.md").read_text()
TELL_APART = (DOCS / "how-to" / "tell-effects-apart.md").read_text()

#: Everything that a diagnosis can name, with the texts from which the reference is generated.
NAMED = {**CATALOGUE, **OF_EACH, **DETECTORS}


@pytest.mark.parametrize("name", NAMED)
def test_the_reference_has_all_texts_of_an_effect(name: str) -> None:
    entry = NAMED[name]
    assert entry.summary
    assert entry.similar_to
    assert entry.distinguished_by


@pytest.mark.parametrize("name", NAMED)
def test_similar_effects_have_names_of_the_catalogue(name: str) -> None:
    assert {*re.findall(r"[a-z]+(?:-[a-z]+)+", NAMED[name].similar_to)} <= NAMED.keys()


def test_the_guide_has_the_parameters_that_the_reference_does_not_have() -> None:
    _, _, section = TELL_APART.partition("## Read the parameters")
    assert re.findall(r"^\| `([a-z-]+)` \| .+ \|$", section, re.MULTILINE) == [*OF_EACH, *DETECTORS]


def test_the_guide_of_the_diagnosis_has_every_verdict() -> None:
    assert not [verdict for verdict in Verdict if f"| `{verdict}` |" not in DIAGNOSE]
