"""The guides and the generated reference of the diagnosis agree with the code: effects and verdicts."""

import re

import pytest

from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.diagnosis.inference.verdict import Verdict
from islands.effects.catalogue import CATALOGUE, OF_EACH
from support.repository import DOCS, ROOT

DIAGNOSE = (DOCS / "how-to" / "diagnose-a-simulation.md").read_text()
TELL_APART = (DOCS / "how-to" / "tell-effects-apart.md").read_text()

#: Everything that a diagnosis can name, with the texts from which the reference is generated.
NAMED = {**CATALOGUE, **OF_EACH, **DETECTORS}


def test_the_reference_has_all_texts_of_an_effect() -> None:
    for name, entry in NAMED.items():
        assert all((entry.summary, entry.similar_to, entry.distinguished_by)), name


def test_the_guide_has_the_parameters_that_the_reference_does_not_have() -> None:
    _, _, section = TELL_APART.partition("## Read the parameters")
    assert re.findall(r"^\| `([a-z-]+)` \| .+ \|$", section, re.MULTILINE) == [*OF_EACH, *DETECTORS]


def test_the_guide_of_the_diagnosis_has_every_verdict() -> None:
    assert not [verdict for verdict in Verdict if f"| `{verdict}` |" not in DIAGNOSE]


#: Places of the guide to additions: the items of its lists and the rows of its tables.
PLACES = re.findall(
    r"^(?:\d+\. |\| [a-z]).+(?:\n   .+)*", (DOCS / "how-to" / "add-to-islands.md").read_text(), re.M
)


@pytest.mark.parametrize("place", PLACES, ids=range(len(PLACES)))
def test_a_place_of_the_guide_to_additions_exists_and_has_its_table(place: str) -> None:
    """``NAME`` in a path is that of the addition."""
    spans = re.findall(r"`([^`]+)`", place)
    paths = [ROOT / each for each in spans if re.match(r"(src|services|api|lab|tests|docs|deploy)/", each)]
    found = [path for path in paths if not re.search(r"NAME|FAMILY", path.name)]
    assert all(path.exists() for path in found), place
    # Further files of a place are next to the first one.
    neighbours = [paths[0].parent / each for each in spans if paths]
    found += [path for path in neighbours if path.is_file()]
    files = [each for path in found for each in (path.glob("*.*") if path.is_dir() else [path])]
    text = "\n".join(file.read_text("utf-8") for file in files if file.is_file())
    tables = [each for each in spans if re.fullmatch(r"_?[A-Z]+(_[A-Z]+)*", each)]
    assert not [each for each in tables if found and each not in text], place
