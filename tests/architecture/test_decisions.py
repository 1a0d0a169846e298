"""Decisions have the form that docs/decisions/index.md states, and dependencies their reason."""

import re
import tomllib
from datetime import date
from pathlib import Path

import pytest

from support.pages import prose
from support.repository import DOCS, ROOT

FOLDER = DOCS / "decisions"
INDEX = FOLDER / "index.md"
DECISIONS = sorted(path for path in FOLDER.iterdir() if path != INDEX)

#: Length of a page.
MOST_LINES, MOST_CHARACTERS = 60, 140

SECTIONS = ["Context", "Decision", "Consequences"]
HEAD = re.compile(r"# (.+)\n\n\* Status: (.+)\n\* Date: (.+)\n\n## Context\n")
STATUS = re.compile(r"accepted(; .+ superseded by \[\d{4}\]\(.+\))?|superseded by \[\d{4}\]\(.+\)")
DATE = re.compile(r"(\d{4}-\d\d-\d\d)(?:, revised (\d{4}-\d\d-\d\d))?")


@pytest.fixture(params=DECISIONS, ids=lambda path: path.stem)
def decision(request: pytest.FixtureRequest) -> Path:
    return request.param


def read_head(decision: Path) -> tuple[str, str, str]:
    """Return title, status and date."""
    found = HEAD.match(decision.read_text("utf-8"))
    assert found, f"{decision.name} begins with title, status, date and context"
    return found[1], found[2], found[3]


def test_a_decision_has_three_sections_in_order(decision: Path) -> None:
    assert re.findall(r"^##+ (.+)$", prose(decision), re.MULTILINE) == SECTIONS
    parts = re.split(r"^## .+$", prose(decision), flags=re.MULTILINE)
    assert all(part.strip() for part in parts), "no section is empty"


def test_a_decision_is_one_page(decision: Path) -> None:
    lines = decision.read_text("utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    wide = [line for line in lines if len(line) > MOST_CHARACTERS and not line.startswith("|")]
    assert not wide


def test_a_decision_is_accepted_or_names_its_successor(decision: Path) -> None:
    _, status, _ = read_head(decision)
    assert STATUS.fullmatch(status), status
    for number, file in re.findall(r"\[(\d{4})\]\((.+?)\)", status):
        assert file.startswith(number)
        assert (FOLDER / file).exists()
        assert number > decision.stem[:4]


def test_a_decision_has_a_date_and_no_earlier_revision(decision: Path) -> None:
    _, _, written = read_head(decision)
    found = DATE.fullmatch(written)
    assert found, written
    decided, revised = (date.fromisoformat(day) if day else None for day in found.groups())
    assert decided
    assert revised is None or revised > decided


def test_the_index_has_the_number_and_the_title_of_every_decision() -> None:
    rows = re.findall(r"^\| \[(\d{4})\]\((.+)\) \| (.+) \|$", INDEX.read_text("utf-8"), re.MULTILINE)
    assert rows == [(path.stem[:4], path.name, read_head(path)[0]) for path in DECISIONS]


def test_numbers_of_decisions_are_unique() -> None:
    numbers = [path.name[:5] for path in DECISIONS]
    assert len({*numbers}) == len(numbers)
    assert all(re.fullmatch(r"\d{4}-", number) for number in numbers)


def test_every_cited_decision_exists() -> None:
    """Comments and pages cite a decision by its number."""
    numbers = {path.name[:4] for path in DECISIONS}
    folders = ("src", "services", "api", "lab", "tests", "docs", "deploy")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.*")]
    for path in [*files, *ROOT.glob("*.md")]:
        if path.suffix not in {".py", ".md"}:
            continue
        cited = re.findall(r"[Dd]ecision\s+(\d{4})\b", path.read_text("utf-8"))
        assert {*cited} <= numbers, path


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    extras = project["project"]["optional-dependencies"].values()
    groups = project["dependency-groups"].values()
    required = [line for lines in (project["project"]["dependencies"], *extras, *groups) for line in lines]
    names = {re.split(r"[\[<>=]", line)[0] for line in required} - {project["project"]["name"]}
    reasons = next(path for path in DECISIONS if path.stem.endswith("dependencies")).read_text("utf-8")
    assert not [name for name in names if not re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", reasons)]
