"""The laboratory starts in a checkout, and its commands say where they are without one."""

import pytest

from islands.cli.app import MEASUREMENTS
from support.command_line import fail, succeed


def test_a_command_runs_in_a_checkout() -> None:
    assert "cascaded_tanks.csv is missing" in succeed("benchmark", "--data", "absent")


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_a_command_without_a_checkout_names_it(name: str, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("islands.cli.laboratory.LABORATORY", tmp_path / "lab")
    said = " ".join(fail(name, "--help").split())
    assert f"islands {name} is part of the laboratory" in said
    assert "run it in a checkout of the repository" in said


def test_the_self_test_without_a_checkout_names_it(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("islands.cli.laboratory.LABORATORY", tmp_path / "lab")
    columns = ("--input", "u_V", "--output", "y_um", "--simulation", "linear:1")
    said = fail("diagnose", tmp_path / "r.csv", *columns, "--self-test", "--out", tmp_path / "out")
    assert "--self-test is part of the laboratory" in " ".join(said.split())
