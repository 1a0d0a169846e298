"""Table of the benchmarks: complete entries, and no search that knows one of them."""

import re

from lab.published_sets.catalogue import MEASURED
from lab.published_sets.public_package import PACKAGE
from support.repository import ROOT

#: Packages of what a search consists of.
SEARCH = (
    *("data", "estimation", "evolution", "expressions", "facade", "inspection", "kernels", "models"),
    *("program", "simulation", "validation"),
)


def test_no_search_knows_a_benchmark():
    """Names of sets and of files with any separator; ``bouc-wen-piezo`` and the like are other systems."""
    names = {*MEASURED, *(file for entry in MEASURED.values() for file in entry.files), PACKAGE}
    paths = [path for folder in SEARCH for path in (ROOT / "src" / "islands" / folder).rglob("*.py")]
    assert len(paths) > 200
    found = []
    for path in paths:
        text = normalise(path.read_text("utf-8"))
        found += [f"{path.name}: {name}" for name in map(normalise, names) if contains(text, name)]
        assert "islands-benchmarks" not in text
    assert not found


def contains(text, name):
    return name in text and re.search(rf"(?<![a-z-]){name}(?![a-z-])", text) is not None


def normalise(text):
    """Return a text in lower case with one separator of words."""
    return re.sub("[-_. ]", "-", text.lower())


def test_a_name_in_a_search_would_be_found():
    text = normalise("if record.name == 'Gas_furnace':")
    assert [name for name in MEASURED if contains(text, name)] == ["gas-furnace"]
    assert not contains(normalise("bouc-wen-piezo"), "bouc-wen")
