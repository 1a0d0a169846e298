"""Examples: scripts that run, check what their text says, and use public names only."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import islands
import islands.effects
from docs._scripts import tutorials

EXAMPLES = tutorials.list_examples()
IDS = [path.stem for path in EXAMPLES]

#: Public names of the packages that examples may import.
PUBLIC = {
    "islands": set(islands.__all__),
    "islands.effects": set(islands.effects.__all__),
    "islands_api": {"Client", "AsyncClient"},
}

#: Libraries that examples may import besides the standard library.
LIBRARIES = {"matplotlib.pyplot", "numpy", "scipy.signal"}

#: Seconds after which an example has failed.
PATIENCE = 240


def run(path: Path, *arguments: object, **environment: str) -> str:
    """Run an example as a script; return its output."""
    done = subprocess.run(
        [sys.executable, path, *map(str, arguments)],
        env={**os.environ, "MPLBACKEND": "agg", **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


#: Examples of the nightly level: those that take five seconds of CPU and more, and the one that the test of a
#: temporary folder runs.
SLOW = ("01_", "02_", "03_", "04_", "05_", "06_", "07_", "08_", "09_", "10_")


@pytest.mark.ci
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=pytest.mark.nightly) if path.name.startswith(SLOW) else path
        for path in EXAMPLES
    ],
    ids=IDS,
)
def test_example_runs_and_its_checks_pass(path: Path, tmp_path: Path) -> None:
    printed = run(path, "--out", tmp_path / "out")
    assert printed.splitlines()[-1] == f"results in {tmp_path / 'out'}"
    assert any((tmp_path / "out").iterdir())


@pytest.mark.ci
def test_example_without_out_names_a_temporary_folder(tmp_path: Path) -> None:
    printed = run(tutorials.ROOT / "examples" / "10_export_to_c.py", TMPDIR=str(tmp_path))
    folder = Path(printed.splitlines()[-1].removeprefix("results in "))
    assert folder.parent == tmp_path
    assert (folder / "model.c").exists()


@pytest.mark.nightly
def test_cluster_example_gives_the_same_models_on_a_cluster(ray_address: str, tmp_path: Path) -> None:
    path = tutorials.ROOT / "examples" / "05_cluster.py"
    by_option = run(path, "--out", tmp_path / "a", "--address", ray_address)
    by_variable = run(path, "--out", tmp_path / "b", ISLANDS_RAY_ADDRESS=ray_address)
    assert by_option.startswith(f"cluster {ray_address}\n")
    assert by_variable.startswith(f"cluster {ray_address}\n")
    assert (tmp_path / "a" / "model.json").read_bytes() == (tmp_path / "b" / "model.json").read_bytes()


@pytest.mark.parametrize("path", EXAMPLES, ids=IDS)
def test_links_of_an_example_lead_to_other_examples(path: Path) -> None:
    example = tutorials.parse(path)
    text = "\n".join(cell.text for cell in example.cells)
    links = re.findall(r"\]\(([^)]+)\)", example.introduction + text)
    assert {link.removesuffix(".md") for link in links} <= {*IDS} - {path.stem}


@pytest.mark.parametrize("path", EXAMPLES, ids=IDS)
def test_example_uses_public_names_only(path: Path) -> None:
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                known = alias.name == "islands" or alias.name in LIBRARIES
                assert known or alias.name in sys.stdlib_module_names, alias.name
        elif isinstance(node, ast.ImportFrom) and node.module not in LIBRARIES:
            module = str(node.module)
            names = {alias.name for alias in node.names}
            assert module in sys.stdlib_module_names or names <= PUBLIC.get(module, set()), (module, names)
        elif isinstance(node, ast.Attribute):
            of_package = isinstance(node.value, ast.Name) and node.value.id == "islands"
            assert not of_package or node.attr in PUBLIC["islands"], node.attr
            assert not node.attr.startswith("_"), node.attr
