"""Table of the benchmarks: complete entries, and no search that knows one of them."""

import re

import pytest

from islands.benchmarks.catalogue import MEASURED, find_benchmark
from islands.benchmarks.public_package import PACKAGE
from islands.errors import SettingsError
from support.repository import ROOT

#: Packages of what a search consists of.
SEARCH = (
    *("data", "estimation", "evolution", "expressions", "facade", "inspection", "kernels", "models"),
    *("program", "simulation", "validation"),
)


@pytest.mark.parametrize("name", MEASURED)
def test_an_entry_says_what_a_result_depends_on(name):
    entry = MEASURED[name]
    assert entry.description.endswith(".")
    assert entry.rule
    assert entry.address
    assert entry.licence
    assert all(re.fullmatch("[0-9a-f]{64}", each) for each in entry.files.values())
    for found in entry.published.values():
        assert [each.value for each in found] == sorted(each.value for each in found)
        assert all(each.method and each.source for each in found)


def test_the_sets_without_a_part_in_the_search_are_those_of_the_page():
    untuned = {name for name, entry in MEASURED.items() if not entry.is_tuned}
    assert untuned == {"fine-steering-mirror", "gas-furnace"}


def test_an_unknown_set_is_an_error_with_similar_names():
    with pytest.raises(SettingsError, match="Did you mean 'silverbox'"):
        find_benchmark("silver-box")


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
