"""Page of a reproduction: one file for both themes that needs nothing from outside."""

import json
import re

import pytest

from islands.report.figures.style import blank, finish
from islands.report.figures.themes import THEMES, themed_style
from islands.reproduction.page import write_reproduction
from islands.reproduction.section import ComparisonTable, Section, SectionFigure


def draw(theme):
    with themed_style(theme):
        figure = blank(1.0)
        figure.subplots().plot([0, 1], [1, 0])
        return finish(figure)


SECTION = Section(
    "Case <1>",
    ("A paragraph & more.",),
    (ComparisonTable("Sizes", (("terms", "9", "7", "another <seed>"),)),),
    (SectionFigure("figure-5", "Loops", draw),),
    {"size": 7},
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page") / "new"
    write_reproduction([SECTION], folder)
    return folder


def test_page_has_no_script_and_no_address(folder):
    page = (folder / "reproduction.html").read_text()
    assert "<script" not in page
    assert not re.findall(r'(?:src|href|srcset)="(?!data:)', page)
    assert not re.findall(r"https?://|@import|url\(", re.sub(r"base64,[\w+/=]+", "", page))


def test_texts_are_escaped(folder):
    page = (folder / "reproduction.html").read_text()
    for text in ("Case &lt;1&gt;", "A paragraph &amp; more.", "another &lt;seed&gt;"):
        assert text in page


def test_page_and_folder_have_each_figure_in_both_themes(folder):
    page = (folder / "reproduction.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == len(THEMES)
    assert "prefers-color-scheme: dark" in page
    images = sorted(folder.glob("figures/*.svg"))
    assert [path.name for path in images] == ["figure-5-dark.svg", "figure-5.svg"]
    assert images[0].read_bytes() != images[1].read_bytes()


def test_numbers_have_tables_and_values(folder):
    document = json.loads((folder / "reproduction.json").read_text())["Case <1>"]
    assert document["numbers"] == {"size": 7}
    assert document["tables"][0]["rows"] == [["terms", "9", "7", "another <seed>"]]
    assert document["tables"][0]["columns"][-1] == "why they differ"


def test_equal_sections_give_equal_bytes(folder, tmp_path):
    write_reproduction([SECTION], tmp_path)
    for path in (path for path in folder.rglob("*") if path.is_file()):
        assert (tmp_path / path.relative_to(folder)).read_bytes() == path.read_bytes()
