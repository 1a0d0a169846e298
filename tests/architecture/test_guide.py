"""The written documentation agrees with the code: effects, simulations, verdicts, links and pictures."""

import re
from pathlib import Path

import numpy as np
import pytest

from islands.discrepancy.effects import CATALOGUE, OF_EACH
from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.effect import SimulationContext
from islands.io.simulator_spec.specification import KINDS
from support.repository import DOCS, ROOT

DIAGNOSE = (DOCS / "how-to" / "diagnose-a-simulation.md").read_text()

#: Cells of a row of the table of effects by name: parameters, similar effects, distinguishing observation.
ROWS = {
    name: [cell.strip() for cell in cells.split("|")]
    for name, cells in re.findall(
        r"^\| `([a-z-]+)` \|((?:[^|]+\|){2}[^|]+) \|$",
        (DOCS / "how-to" / "tell-effects-apart.md").read_text(),
        re.MULTILINE,
    )
}

#: Folders of pages that are generated, and need not exist in a checkout.
GENERATED = ("reference", "tutorials")

#: Pages that are written by hand.
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *(page for page in sorted(DOCS.rglob("*.md")) if page.relative_to(DOCS).parts[0] not in GENERATED),
]


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_table_of_effects_has_every_effect_and_no_other() -> None:
    assert ROWS.keys() == {*CATALOGUE, *OF_EACH, *DETECTORS}


@pytest.mark.parametrize("name", [*CATALOGUE, *OF_EACH, *DETECTORS])
def test_every_row_of_the_table_of_effects_is_complete(name: str) -> None:
    parameters, alike, apart = ROWS[name]
    assert parameters
    assert alike
    assert apart


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_table_of_effects_has_the_parameters_of_an_effect(name: str, scene: SimulationContext) -> None:
    in_guide = re.findall(r"`([^`]+)`", ROWS[name][0])
    assert [each.name for each in CATALOGUE[name].parameters(scene)] == in_guide


def test_the_guide_of_the_diagnosis_has_every_simulation_and_every_verdict() -> None:
    assert not [kind for kind in KINDS if not re.search(rf"^\| `{kind}[\[:`]", DIAGNOSE, re.MULTILINE)]
    assert not [verdict for verdict in Verdict if f"| `{verdict}` |" not in DIAGNOSE]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_of_a_page_lead_to_existing_places(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in link:
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        if target.is_relative_to(DOCS) and target.relative_to(DOCS).parts[0] in GENERATED:
            continue
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


def test_pictures_are_small_and_all_are_shown() -> None:
    shown = "".join(page.read_text() for page in PAGES)
    for picture in (DOCS / "pictures").iterdir():
        assert f"pictures/{picture.name}" in shown
        assert picture.stat().st_size < 200_000, picture


@pytest.fixture(scope="module")
def scene() -> SimulationContext:
    u = np.sin(np.arange(400) / 20)
    return SimulationContext(u, 0.01, {"T": u, "w": u}, {"T": "K", "w": "V"}, 1.0, 1.0, "V", "um", 3.0)
