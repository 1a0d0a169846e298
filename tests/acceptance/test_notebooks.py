"""Notebooks: they are committed without outputs, run from the beginning, and find what their text says."""

import json
from pathlib import Path

import pytest

from support.repository import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))

#: Text in an output of each notebook.
FOUND = {
    "dead_time": "u(k-12)",
    "friction": "sign(y(k-1))",
    "hysteresis": "sign(u(k-",
    "tanks": "r2_val",
}


def cells(path: Path) -> list[dict]:
    return json.loads(path.read_text("utf-8"))["cells"]


def test_every_notebook_has_an_expected_output() -> None:
    assert {path.stem for path in NOTEBOOKS} == set(FOUND)
    readme = (ROOT / "examples" / "README.md").read_text("utf-8")
    assert not [path.name for path in NOTEBOOKS if f"notebooks/{path.name}" not in readme]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_without_outputs(path: Path) -> None:
    first, *_ = cells(path)
    assert "".join(first["source"]).startswith("# ")
    for cell in cells(path):
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.nightly, id=path.stem) for path in NOTEBOOKS],
)
def test_a_notebook_runs_and_finds_its_law(path: Path, tmp_path: Path) -> None:
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=240, resources={"metadata": {"path": tmp_path}}).execute()
    outputs = json.dumps([cell.get("outputs") for cell in notebook.cells])
    assert FOUND[path.stem] in outputs
    assert "image/svg+xml" in outputs or "image/png" in outputs
