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


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_failing_example_is_reported_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tutorials, "CACHE", tmp_path / "cache")
    path = tmp_path / "13_test.py"
    path.write_text('"""A title."""\n\n# %%\n# Text.\nprint(1)\nraise SystemExit("no")\n')
    with pytest.raises(RuntimeError, match=r"13_test\.py ended with exit code 1"):
        tutorials.execute(path)
    path.write_text('"""A title."""\n\n# %%\n# Text.\nprint(1)\nprint(1 / 0)\n')
    with pytest.raises(RuntimeError, match=r'13_test\.py", line 6'):
        tutorials.execute(path)
