"""What a diagnosis has extended is a model like any other at the front door: simulated, shown, run."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from islands.discrepancy.calibration.levenberg_marquardt import Target, evaluate_fit
from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.io.records import write_record
from islands.io.simulator_spec.document import extended_json
from support.command_line import fail, succeed
from support.simulated_records import made

#: A stiffness of the third power, in V / um^3.
STRENGTH = 3e-5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of a piezo with a cubic in it, and the simulation with the same."""
    base = tmp_path_factory.mktemp("extended")
    asked = made()["bouc-wen-piezo"]
    effect, record = CATALOGUE["cubic-stiffness"], asked.record
    core = asked.core
    simulation = ExtendedSimulator(core, (effect,), make_context(record, core, count_fitted_samples(record)))
    values = simulation.nominal
    values[simulation.get_slice(effect)] = STRENGTH
    measured = replace(record, y=simulation.simulate(values))
    target = Target(measured.y, np.ones(record.samples, dtype=bool), None, {})
    write_record(measured, base / "record.csv")
    (base / "extended.json").write_text(extended_json(evaluate_fit(simulation, target, values), measured))
    return base


def column(path: Path) -> np.ndarray:
    table = np.genfromtxt(path, delimiter=",", names=True)
    return np.asarray(table["y_sim"])


def measured(folder: Path) -> np.ndarray:
    table = np.genfromtxt(folder / "record.csv", delimiter=",", names=True)
    return np.asarray(table["y_um"])


def test_it_is_simulated(folder: Path) -> None:
    out = folder / "simulated.csv"
    said = succeed("simulate", folder / "extended.json", folder / "record.csv", "--out", out)
    assert "free-run: cubic-stiffness in it" in said
    assert "MAPE 0.0000 %" in said
    assert column(out) == pytest.approx(measured(folder), abs=1e-6)


def test_it_is_shown_in_words(folder: Path) -> None:
    said = succeed("show", folder / "extended.json", "--format", "plain")
    assert "y_um from u_V: bouc-wen-piezo" in said
    assert "cubic-stiffness (coordinate and rate): An odd part of the characteristic: + k x^3" in said
    assert "k = 3e-05 um/V^3" in said


def test_it_is_shown_as_the_file_that_it_is(folder: Path) -> None:
    said = succeed("show", folder / "extended.json", "--format", "json")
    assert said == (folder / "extended.json").read_text()


@pytest.mark.ci
def test_it_is_shown_as_a_program_that_runs(folder: Path) -> None:
    program, out = folder / "program.py", folder / "by_program.csv"
    program.write_text(succeed("show", folder / "extended.json", "--format", "python"))
    subprocess.run([sys.executable, program, folder / "record.csv", out], check=True, timeout=120)
    found = np.loadtxt(out, skiprows=1)
    assert found == pytest.approx(measured(folder), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "options", "why"),
    [
        ({}, ("--mode", "one-step"), "an extended simulation runs free"),
        ({"times": 0}, (), "times"),
        ({"core": {"kind": "pendulum"}}, (), "pendulum"),
        ({"effects": [{"name": "wormhole", "parameters": {}}]}, (), "knows no effect 'wormhole'"),
        ({"inputs": ["u_A"]}, (), "no column u_A"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_a_line(
    folder: Path, tmp_path: Path, change: dict, options: tuple[str, ...], why: str
) -> None:
    document = json.loads((folder / "extended.json").read_text())
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps({**document, **change}))
    assert why in fail("simulate", wrong, folder / "record.csv", *options)


def test_a_format_that_it_has_not_is_refused(folder: Path) -> None:
    assert "unknown format of an extended simulation 'c'" in fail(
        "show", folder / "extended.json", "--format", "c"
    )
