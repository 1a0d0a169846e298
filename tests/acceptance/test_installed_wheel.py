"""The installed package without its sources: a dozen commands, each in a separate process."""

import json
import os
import subprocess
import sys
import sysconfig
from importlib.resources import files
from pathlib import Path

import pytest

from support.command_line import BUDGET, COLUMNS, ISLANDS, write_hysteresis, write_offset

pytestmark = pytest.mark.ci

#: Data files by package, which reports, the dashboard and type checkers need.
DATA = {
    "islands": ("py.typed", "report/pages/templates/report.html", "templates/result.txt"),
    "islands_api": ("py.typed", "dashboard/index.html", "dashboard/islands.css", "dashboard/islands.js"),
    "islands_service": ("py.typed",),
}


def run(*arguments: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the command in a separate process, in a folder without sources."""
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    command = [str(ISLANDS), *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=240
    )


def succeed(*arguments: object, folder: Path) -> str:
    done = run(*arguments, folder=folder)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a record of an actuator (5 s) and one of a hysteresis (1000 samples)."""
    base = tmp_path_factory.mktemp("user")
    succeed("examples", "long.csv", "--system", "bouc-wen-piezo", "--set", "part=validation", folder=base)
    lines = (base / "long.csv").read_text().splitlines(keepends=True)
    (base / "piezo.csv").write_text("".join(lines[:5001]))
    lines = write_hysteresis(base / "hysteresis.csv").read_text().splitlines(keepends=True)
    (base / "hysteresis.csv").write_text("".join(lines[:1001]))
    return base


@pytest.fixture(scope="module")
def model(folder: Path) -> str:
    """The best model of a fit."""
    succeed(
        "fit",
        "piezo.csv",
        *COLUMNS,
        "--library",
        "phi-polynomial",
        "--max-terms",
        4,
        "--out",
        "fit",
        folder=folder,
    )
    return "fit/models/01.json"


def test_packages_are_installed_with_their_data(folder: Path) -> None:
    for package, names in DATA.items():
        for name in names:
            assert files(package).joinpath(name).is_file(), (package, name)
    program = "import islands; assert islands.read_record and islands.fit; print(islands.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True, timeout=120
    )
    assert Path(done.stdout.strip()).is_relative_to(sysconfig.get_path("purelib"))


def test_fit_writes_models_and_figures(folder: Path, model: str) -> None:
    result = json.loads((folder / "fit/result.json").read_text())
    assert result["models"][0]["physics"]["property_1"] is True
    figures = sorted((folder / "fit/figures").glob("*.svg"))
    assert [path.stem for path in figures] == ["free-run"]
    assert figures[0].stat().st_size > 5_000
    assert (folder / model).is_file()


def test_model_is_shown_as_text_and_as_a_valid_program(folder: Path, model: str) -> None:
    assert "(k) = " in succeed("show", model, folder=folder).partition("\n")[0]
    source = succeed("show", model, "--format", "python", folder=folder)
    names: dict[str, object] = {}
    exec(source, names)
    assert callable(names["simulate"])


def test_model_is_simulated(folder: Path, model: str) -> None:
    printed = succeed("simulate", model, "piezo.csv", "--out", "simulated.csv", folder=folder)
    assert "ok" in printed
    assert len((folder / "simulated.csv").read_text().splitlines()) == 5_001


def test_small_search_finds_models(folder: Path) -> None:
    search = ("--generations", 2, "--engine", "serial", "--out", "found")
    succeed("identify", "hysteresis.csv", *COLUMNS, *BUDGET, *search, folder=folder)
    result = json.loads((folder / "found/result.json").read_text())
    assert result["search"]["evaluations"] == 3 * 30
    assert result["models"]


def test_diagnosis_writes_a_report(folder: Path) -> None:
    write_offset(folder / "offset.csv")
    succeed(
        *("diagnose", "offset.csv", *COLUMNS, "--simulation", "column:theirs_um", "--out", "diagnosis"),
        folder=folder,
    )
    document = json.loads((folder / "diagnosis/discrepancy.json").read_text())
    assert [effect["name"] for effect in document["effects"]] == ["offset"]
    assert "<img " in (folder / "diagnosis/report.html").read_text()
