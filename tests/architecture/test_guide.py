"""The guide of the discrepancy analysis says what the code has: effects, simulations, verdicts, pictures."""

import re

import numpy as np
import pytest

from islands.discrepancy.effects import CATALOGUE, OF_EACH, summary_of
from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.effect import SimulationContext
from islands.io.simulator_spec.specification import KINDS
from support.repository import DOCS

GUIDE = (DOCS / "discrepancy.md").read_text()

#: A row of the catalogue: what stands behind a name and its family.
ROWS = {
    name: [cell.strip().replace("&#124;", "|") for cell in cells.split("|")]
    for name, cells in re.findall(r"^\| `([a-z-]+)`, ([a-z]+(?: \|[^|]+){4}) \|$", GUIDE, re.MULTILINE)
}


def said(name: str) -> str:
    return DETECTORS[name].summary if name in DETECTORS else summary_of(name)


def test_the_guide_has_every_effect_and_no_other() -> None:
    assert ROWS.keys() == {*CATALOGUE, *OF_EACH, *DETECTORS}


@pytest.mark.parametrize("name", [*CATALOGUE, *OF_EACH, *DETECTORS])
def test_the_guide_has_the_summary_of_every_effect(name: str) -> None:
    family, what, parameters, alike, apart = ROWS[name]
    assert what == said(name)
    assert parameters
    assert alike
    assert apart
    known = {**CATALOGUE, **DETECTORS}
    assert name not in known or family == known[name].family


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_guide_has_an_effects_parameters(name: str, scene: SimulationContext) -> None:
    in_guide = re.findall(r"`([^`]+)`", ROWS[name][2])
    assert [each.name for each in CATALOGUE[name].parameters(scene)] == in_guide


def test_the_guide_has_every_simulation_and_every_verdict() -> None:
    assert not [kind for kind in KINDS if not re.search(rf"^\| `{kind}[\[:`]", GUIDE, re.MULTILINE)]
    assert not [verdict for verdict in Verdict if f"| `{verdict}` |" not in GUIDE]


def test_links_and_pictures_of_the_guide_lead_somewhere() -> None:
    headings = re.findall(r"^#+ (.+)$", GUIDE, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    links = re.findall(r"\]\(([^)]+)\)", GUIDE)
    assert links
    for link in links:
        file, _, anchor = link.partition("#")
        assert not file or (DOCS / file).is_file(), link
        assert file or anchor in anchors, link


def test_pictures_are_small_and_all_are_shown() -> None:
    shown = "".join(path.read_text() for path in DOCS.glob("*.md"))
    for picture in (DOCS / "pictures").iterdir():
        assert f"pictures/{picture.name}" in shown
        assert picture.stat().st_size < 200_000, picture


@pytest.fixture(scope="module")
def scene() -> SimulationContext:
    u = np.sin(np.arange(400) / 20)
    return SimulationContext(u, 0.01, {"T": u, "w": u}, {"T": "K", "w": "V"}, 1.0, 1.0, "V", "um", 3.0)
