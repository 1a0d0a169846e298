"""Commands read their files before they compile kernels."""

import sys

import pytest
from openpyxl import Workbook
from typer.testing import CliRunner

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
