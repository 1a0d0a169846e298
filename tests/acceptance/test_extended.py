"""Extended simulations on the command line: simulate, show and export."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import evaluate_fit
from islands.diagnosis.calibration.preparation import count_fitted_samples
from islands.diagnosis.calibration.target import Target
from islands.effects.catalogue import CATALOGUE
from islands.export.fmu import find_compiler
from islands.records.writer import write_record
from islands.report.documents.extension import extended_json
from islands.simulators.extended import ExtendedSimulator, make_context
from support.command_line import fail, succeed
from support.simulated_records import EQUATIONS, made, write_fmu

#: Cubic stiffness in V / um^3.
STRENGTH = 3e-5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record of a piezo with a cubic stiffness, and the simulation extended by it."""
    base = tmp_path_factory.mktemp("extended")
    example = made()["bouc-wen-piezo"]
    effect, record = CATALOGUE["cubic-stiffness"], example.record
    core = example.simulator
    simulation = ExtendedSimulator(core, (effect,), make_context(record, core, count_fitted_samples(record)))
    values = simulation.nominal
    values[simulation.get_slice(effect)] = STRENGTH
    measured = replace(record, y=simulation.simulate(values))
    target = Target(measured.y, np.ones(record.samples, dtype=bool), None, {}, fitted=record.samples)
    write_record(measured, base / "record.csv")
    (base / "extended.json").write_text(extended_json(evaluate_fit(simulation, target, values), measured))
    return base


def column(path: Path) -> np.ndarray:
    table = np.genfromtxt(path, delimiter=",", names=True)
    return np.asarray(table["y_sim"])


def measured(folder: Path) -> np.ndarray:
    table = np.genfromtxt(folder / "record.csv", delimiter=",", names=True)
    return np.asarray(table["y_um"])


@pytest.mark.ci
def test_extended_simulation_reproduces_the_record(folder: Path) -> None:
    out = folder / "simulated.csv"
    printed = succeed("simulate", folder / "extended.json", folder / "record.csv", "--out", out)
    assert "free-run: with cubic-stiffness" in printed
    assert "MAPE 0.0000 %" in printed
    assert column(out) == pytest.approx(measured(folder), abs=1e-6)


@pytest.mark.ci
def test_exported_program_reproduces_the_record(folder: Path) -> None:
    program, out = folder / "program.py", folder / "by_program.csv"
    program.write_text(succeed("show", folder / "extended.json", "--format", "python"))
    subprocess.run([sys.executable, program, folder / "record.csv", out], check=True, timeout=120)
    found = np.loadtxt(out, skiprows=1)
    assert found == pytest.approx(measured(folder), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({}, ("--mode", "one-step"), "a simulation supports free runs only"),
        ({"times": 0}, (), "times"),
        ({"core": {"kind": "pendulum"}}, (), "pendulum"),
        ({"effects": [{"name": "wormhole", "parameters": {}}]}, (), "has no effect 'wormhole'"),
        ({"inputs": ["u_A"]}, (), "no column u_A"),
    ],
)
def test_invalid_extended_simulation_is_rejected_in_one_line(
    folder: Path, tmp_path: Path, change: dict, options: tuple[str, ...], message: str
) -> None:
    document = json.loads((folder / "extended.json").read_text())
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps({**document, **change}))
    assert message in fail("simulate", wrong, folder / "record.csv", *options)


def test_unsupported_format_is_rejected(folder: Path) -> None:
    for options in (("modelica",), ("fmu", "--out", folder / "piezo.fmu")):
        message = fail("show", folder / "extended.json", "--format", *options)
        assert "bouc-wen-piezo has no closed form as a difference equation: take the format plain" in message


def test_a_simulation_of_equations_is_written_as_c_and_matlab(folder: Path) -> None:
    out = folder / "simulation.c"
    succeed("show", folder, "--format", "c", "--out", out)
    assert out.read_text().rstrip() == succeed("show", folder / "extended.json", "--format", "c").rstrip()
    assert "int simulate(const struct parameters *p," in out.read_text()
    printed = succeed("show", folder, "--format", "matlab")
    assert printed.startswith("function y = extended_simulation(u, initial, p)")


def test_equations_are_simulated_without_a_diagnosis(tmp_path: Path) -> None:
    case = made()["ode"]
    write_record(case.record, tmp_path / "record.csv")
    path = f"ode:{EQUATIONS / 'second-order.toml'}"
    printed = succeed("simulate", path, tmp_path / "record.csv", "--input", "u_N", "--output", "y_m")
    assert "free-run: with second-order" in printed
    assert "R2 1.00000" in printed
    assert "has no column F" in fail("simulate", path, tmp_path / "record.csv")
    assert "free runs only" in fail("simulate", path, tmp_path / "record.csv", "--mode", "one-step")


@pytest.mark.ci
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")
def test_an_fmu_is_simulated_without_a_diagnosis(tmp_path: Path) -> None:
    case = made()["fmu"]
    write_record(case.record, tmp_path / "record.csv")
    columns = (tmp_path / "record.csv", "--input", "u_N", "--output", "y_m")
    printed = succeed("simulate", f"fmu:{write_fmu()}", *columns)
    assert "free-run: with oscillator.fmu" in printed
    assert "R2 1.00000" in printed
    assert "has no column u" in fail("simulate", f"fmu:{write_fmu()}", columns[0])
    assert "has no input 'force': take one of u" in fail(
        "simulate", f"fmu:{write_fmu()}?input=force", *columns
    )
