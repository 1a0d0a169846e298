"""Commands read their files, and look for packages that they need, before they compile kernels."""

import sys

import numpy as np
import pytest
from openpyxl import Workbook
from typer.testing import CliRunner

from islands.records.dataset import Dataset
from islands.records.writer import write_record
from islands_api.cli.app import app


@pytest.mark.parametrize("command", ["fit", "identify", "diagnose"])
def test_a_missing_extra_is_reported_before_kernels_are_compiled(tmp_path, monkeypatch, command):
    Workbook().save(tmp_path / "r.xlsx")
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    more = ["--simulation", "second-order"] if command == "diagnose" else []
    arguments = [command, str(tmp_path / "r.xlsx"), "--input", "u", "--output", "y", *more]

    def compile_kernels():
        raise AssertionError("kernels are compiled before the file is read")

    for module in ("commands.fit", "commands.diagnose", "runs.identify"):
        monkeypatch.setattr(f"islands.cli.{module}.compile_kernels", compile_kernels)
    done = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2, done.output
    assert "needs the extra 'excel'" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("command", "options", "extra"),
    [
        ("identify", ["--engine", "ray"], "ray"),
        ("diagnose", ["--simulation", "fmu:r.fmu"], "fmi"),
        ("trials", ["--core", "second-order", "--ray-address", "127.0.0.1:1"], "ray"),
    ],
)
def test_a_missing_engine_or_simulator_is_reported_before_kernels_are_compiled(
    tmp_path, monkeypatch, command, options, extra
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.fmu").write_bytes(b"not empty")
    write_record(Dataset(np.arange(300.0) % 7, np.arange(300.0) % 11, 0.1), tmp_path / "r.csv")
    monkeypatch.setitem(sys.modules, "fmpy", None)
    monkeypatch.setattr("islands.cli.engines.has_ray", lambda: False)

    def compile_kernels():
        raise AssertionError("kernels are compiled before the packages are looked for")

    for module in (
        "islands.cli.commands.diagnose",
        "islands.cli.runs.identify",
        "islands_measurements.trials",
    ):
        monkeypatch.setattr(f"{module}.compile_kernels", compile_kernels)
    record = [] if command == "trials" else ["r.csv", "--input", "u", "--output", "y", "--out", "out"]
    done = CliRunner().invoke(app, [command, *record, *options])
    assert done.exit_code == 2, (done.output, done.exception)
    assert f"needs the extra '{extra}'" in " ".join(done.stderr.split())
