"""Tutorials: how pages are made of examples."""

from pathlib import Path
from typing import Any

import pytest
from docs._scripts import tutorials

SOURCE = '''"""A title: with a colon.

An introduction.
"""

# %%
# ## A heading
#
# Text with `code`.
import sys
from pathlib import Path

out = Path(sys.argv[2])
print("to", out)

# %%
print("only code")
# an ordinary comment

# %%
# Only text.

# %% checks
assert out
print("hidden")
'''


@pytest.fixture
def example(tmp_path: Path) -> Path:
    path = tmp_path / "11_test.py"
    path.write_text(SOURCE)
    return path


def test_parser_separates_text_from_code(example: Path) -> None:
    parsed = tutorials.parse(example)
    assert (parsed.name, parsed.title) == ("11_test", "A title: with a colon")
    assert parsed.introduction == "An introduction."
    assert [cell.text for cell in parsed.cells] == ["## A heading\n\nText with `code`.", "", "Only text.", ""]
    assert [cell.shown for cell in parsed.cells] == [True, True, True, False]
    assert parsed.cells[1].code.strip() == 'print("only code")\n# an ordinary comment'


def test_parser_knows_the_line_of_each_code(example: Path) -> None:
    lines = example.read_text().splitlines()
    for cell in tutorials.parse(example).cells:
        if cell.code.strip():
            assert lines[cell.line - 1] == cell.code.splitlines()[0]


@pytest.mark.parametrize("source", ["# %%\nprint(1)\n", '"""A title."""\nprint(1)\n'])
def test_parser_refuses_a_file_without_docstring_or_cells(source: str, tmp_path: Path) -> None:
    path = tmp_path / "12_test.py"
    path.write_text(source)
    with pytest.raises(ValueError, match=r"12_test\.py needs a docstring and cells"):
        tutorials.parse(path)


def test_page_shows_text_code_output_and_figures_but_no_checks(example: Path) -> None:
    results: list[dict[str, Any]] = [
        {"output": "to out\n", "figures": ["loop.svg"]},
        {"output": "", "figures": []},
        {"output": "", "figures": []},
        {"output": "hidden\n", "figures": []},
    ]
    page = tutorials.render(tutorials.parse(example), results)
    assert page.startswith("# A title: with a colon\n\nAn introduction.\n\n")
    assert "## A heading\n\nText with `code`.\n\n```python\nimport sys\n" in page
    assert '```text title="Output"\nto out\n```\n\n![loop](11_test/loop.svg)\n' in page
    assert "hidden" not in page
    assert "assert out" not in page
    assert "(11_test.py)" in page


def test_build_writes_pages_below_a_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tutorials, "make_pages", lambda: iter([("tutorials/a/b.svg", b"<svg/>")]))
    assert tutorials.build(tmp_path) == [tmp_path / "tutorials" / "a" / "b.svg"]
    assert (tmp_path / "tutorials" / "a" / "b.svg").read_bytes() == b"<svg/>"


@pytest.mark.ci
def test_example_is_executed_once_and_again_after_a_change(
    example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tutorials, "CACHE", tmp_path / "cache")
    first = tutorials.execute(example)
    assert '"to out\\n"' in (first / "cells.json").read_text()
    (first / "cells.json").write_text("kept")
    assert (tutorials.execute(example) / "cells.json").read_text() == "kept"
    example.write_text(SOURCE + "print(1)\n")
    assert tutorials.execute(example) != first
    assert not first.exists()


@pytest.mark.ci
def test_failing_example_is_reported_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tutorials, "CACHE", tmp_path / "cache")
    path = tmp_path / "13_test.py"
    path.write_text('"""A title."""\n\n# %%\n# Text.\nprint(1)\nraise SystemExit("no")\n')
    with pytest.raises(RuntimeError, match=r"13_test\.py ended with exit code 1"):
        tutorials.execute(path)
    path.write_text('"""A title."""\n\n# %%\n# Text.\nprint(1)\nprint(1 / 0)\n')
    with pytest.raises(RuntimeError, match=r'13_test\.py", line 6'):
        tutorials.execute(path)
