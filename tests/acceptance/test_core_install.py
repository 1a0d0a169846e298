"""The core without its extras: the commands of an engineer run, and the others name the extra that they need.

`make release` runs this file in environments that have the core only, without the other files of the
tests. Elsewhere the packages of the extras are hidden.
"""

import csv
import json
import math
import os
import subprocess
import sysconfig
from pathlib import Path

import pytest

pytestmark = pytest.mark.ci

ISLANDS = Path(sysconfig.get_path("scripts")) / "islands"

#: Packages of the extras ray and service.
HIDDEN = (
    *("ray", "alembic", "fastapi", "prometheus_client", "pydantic_settings", "python_multipart"),
    *("sqlalchemy", "starlette", "structlog", "uvicorn"),
)

COLUMNS = ("--input", "u_V", "--output", "y_um")

SEARCH = (
    *("--set", "population=20", "--generations", 1, "--max-terms", 3, "--set", "shooting=50"),
    *("--islands", 2),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with a record of a saturating first-order system."""
    base = tmp_path_factory.mktemp("core")
    hide = f"import sys\nsys.modules.update(dict.fromkeys({HIDDEN!r}))\n"
    (base / "sitecustomize.py").write_text(hide)
    y = 0.0
    with (base / "record.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t_s", "u_V", "y_um", "simulated_um"])
        for k in range(800):
            u = math.sin(0.05 * k) + 0.5 * math.sin(0.23 * k)
            writer.writerow([round(0.01 * k, 2), u, y, y - 0.3 + 0.01 * math.sin(1e4 * k)])
            y = 0.8 * y + 0.3 * u - 0.05 * u**3
    return base


def run(folder, *arguments):
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [str(ISLANDS), *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def succeed(folder, *arguments):
    done = run(folder, *arguments)
    assert done.returncode == 0, done.stderr
    return done


def test_the_help_lists_commands_of_all_extras(folder):
    printed = succeed(folder, "--help").stdout
    for command in ("identify", "fit", "diagnose", "simulate", "show", "examples", "serve", "jobs", "admin"):
        assert f" {command} " in printed


@pytest.mark.nightly
def test_a_record_is_fitted_simulated_and_exported(folder):
    succeed(folder, "fit", "record.csv", *COLUMNS, "--max-terms", 4, "--out", "fit")
    succeed(folder, "simulate", "fit", "record.csv", "--out", "simulated.csv")
    assert "(k) = " in succeed(folder, "show", "fit").stdout.partition("\n")[0]
    succeed(folder, "show", "fit", "--format", "fmu", "--out", "model.fmu")
    assert (folder / "model.fmu").read_bytes().startswith(b"PK")


@pytest.mark.nightly
def test_a_search_of_two_islands_runs_serially_and_says_so(folder):
    done = succeed(folder, "identify", "record.csv", *COLUMNS, *SEARCH, "--out", "found")
    assert "engine: serial, on one core" in done.stderr
    assert "-py3-none-any.whl[ray]'" in done.stderr
    assert json.loads((folder / "found/result.json").read_text())["models"]


@pytest.mark.nightly
def test_a_simulation_is_diagnosed(folder):
    simulation = ("--simulation", "column:simulated_um", "--rows", "0:400")
    succeed(folder, "diagnose", "record.csv", *COLUMNS, *simulation, "--out", "diagnosis")
    assert (folder / "diagnosis/report.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("serve",), "islands serve needs the extra 'service'"),
        (("admin", "keys"), "islands admin needs the extra 'service'"),
        (
            ("identify", "record.csv", *COLUMNS, *SEARCH, "--engine", "ray", "--out", "never"),
            "the engine ray needs the extra 'ray'",
        ),
    ],
)
def test_a_missing_extra_is_named_in_one_line(folder, arguments, message):
    done = run(folder, *arguments)
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1].startswith(f"error: {message}: pip install 'FOLDER/")
    assert "Traceback" not in done.stderr
