"""The command line in this process, and records for its tests."""

import csv
import json
import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

ISLANDS = Path(sysconfig.get_path("scripts")) / "islands"

#: Columns of `write_hysteresis`.
COLUMNS = ("--input", "u_V", "--output", "y_um")

#: Settings of a search on that record that takes a second.
BUDGET = (
    *("--preset", "hysteresis", "--set", "population=30", "--max-terms", "5", "--set", "shooting=200"),
    *("--seed", "2"),
)


def write_hysteresis(path: Path) -> Path:
    """Write a record of 4000 samples of a hysteresis."""
    rng = np.random.default_rng(0)
    t = np.arange(4000) * 1e-2
    u = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in ((1, 0.35, 1), (0.6, 0.83, 2), (0.4, 1.4, 3)))
    y = np.zeros(4000)
    for k in range(2, 4000):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.35 * np.tanh(2 * y[k - 1]) * abs(rise)
    y += 2e-3 * rng.normal(size=4000)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t_s", "u_V", "y_um"])
        writer.writerows(zip(t.round(6).tolist(), u.tolist(), y.tolist(), strict=True))
    return path


def write_offset(path: Path) -> Path:
    """Write a record of 400 samples, with a simulation in the column ``theirs_um`` that lacks an offset."""
    rng = np.random.default_rng(6)
    time = 0.01 * np.arange(400)
    u = 40 * np.sin(2 * np.pi * 1.1 * time) * np.sin(2 * np.pi * 0.3 * time + 1)
    simulated = 0.8 * u + 0.001 * u**2
    y = simulated + 0.3 + 0.1 * rng.standard_normal(time.size)
    rows = np.column_stack([time, u, simulated, y])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header="t_s,u_V,theirs_um,y_um", comments="")
    return path


def stored(folder: Path) -> dict[str, Any]:
    """Return the result document of a folder."""
    return json.loads((folder / "result.json").read_text())


def found(folder: Path) -> dict[str, bytes]:
    """Return the hall of fame and the models of a result folder, as bytes."""
    paths = [folder / "hall.json", *sorted((folder / "models").iterdir())]
    return {path.name: path.read_bytes() for path in paths}


def islands(*arguments: object) -> Result:
    """Run a command in this process, which has loaded the kernels; tests of processes use `ISLANDS`.

    It starts no further processes, which would import everything for a part of a second of work, unless an
    argument asks for them.
    """
    from islands import process_pool
    from islands_api.cli.app import app

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_pool, "count_cpus", lambda: 1)
        return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def succeed(*arguments: object) -> str:
    """Run a command, check that it succeeds and return its standard output."""
    done = islands(*arguments)
    assert done.exit_code == 0, done.stderr
    return done.stdout


def fail(*arguments: object) -> str:
    """Run a command, check that it rejects its arguments and return its standard error."""
    done = islands(*arguments)
    assert done.exit_code == 2, (done.exit_code, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr
