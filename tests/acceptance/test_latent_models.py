"""A latent model from the command line: fit, files, simulation, programs, figures."""

import ctypes
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest

import islands
from islands.simulation.predictors import free_run
from support.command_line import ISLANDS, fail, succeed
from support.latent_systems import spring_record
from support.repository import ROOT

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a fit of a cubic spring."""
    folder = tmp_path_factory.mktemp("latent")
    islands.write_record(spring_record(1200, noise=0.02), folder / "spring.csv")
    islands.write_record(spring_record(800, noise=0.02, seed=7), folder / "other.csv")
    columns = ("--input", "u_V", "--output", "y_mm")
    succeed("fit", folder / "spring.csv", *columns, "--model", "latent", "--out", folder / "out")
    return folder


def read(folder):
    return islands.read_record(folder / "other.csv", inputs="u_V", output="y_mm")


def test_the_cubic_spring_is_found(folder):
    found = islands.load(folder / "out").best
    best = found.model
    assert (best.order, len(best.units)) == (2, 1)
    other = read(folder)
    # The noise of the record is 0.02; the linear model has an error of 0.13.
    assert np.nanstd(found.simulate(other).y - other.y) < 0.021
    # The unit reads the states, so the system is no Hammerstein system.
    assert any(name.startswith("w1") for name in best.names)
    text = succeed("show", folder / "out")
    assert f"{best.units[0]}(" in text
    assert "resonance at 5.1" in text
    assert (folder / "out" / "figures").is_dir()
    _, equations = (folder / "out" / "method.txt").read_text().split("Equations by rank", 1)
    for line in equations.splitlines()[1:]:
        assert line.startswith("    ") != line[:2].strip().isdigit()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler")
def test_a_c_file_repeats_the_simulation_from_the_states_that_it_prints(folder, tmp_path):
    printed = " ".join(succeed("simulate", folder / "out", folder / "other.csv").split())
    sample = int(re.search(r"states at sample (\d)", printed)[1])
    start = np.array([float(each) for each in re.findall(r"x\d = (\S+\d)", printed)])
    model, other = islands.load(folder / "out").best.model, read(folder)
    (tmp_path / "model.c").write_text(succeed("show", folder / "out", "--format", "c"))
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "model.c", "-o", "model.so", "-lm"], cwd=tmp_path, check=True)
    u = other.u[sample:, 0].copy()
    y, *states = np.empty((1 + model.order, u.size))
    pointers = (row.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for row in (u, start, y, *states))
    ctypes.CDLL(tmp_path / "model.so").simulate(*pointers, ctypes.c_size_t(u.size))
    first = model.maximum_lag
    assert y[first - sample :] == pytest.approx(free_run(model, other).y[first:], abs=1e-12)
    # The warm-up, which the simulation leaves out, is that of the record.
    assert y[: first - sample] == pytest.approx(other.y[sample:first], abs=0.1)


def test_a_structure_is_that_of_latent_models(folder):
    columns = ("--input", "u_V", "--output", "y_mm", "--out", folder / "refused", "--set")
    text = fail("fit", folder / "spring.csv", *columns, "structure=wiener")
    assert "a structure is a setting of latent models: leave it out, or --model latent" in text
    text = fail("fit", folder / "spring.csv", *columns, "structure=wienr", "--model", "latent")
    assert "Did you mean 'wiener'?" in text


@pytest.mark.nightly
def test_a_fit_has_the_structure_that_is_given(folder):
    found = islands.fit(read(folder)[:300], model="latent", structure="feedback")
    assert found.settings["structure"] == "feedback"
    assert not any(name.startswith("f") for name in found.best.model.parameter_names)


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler")
def test_the_example_of_the_guide_leads_from_a_record_to_a_program(tmp_path):
    guide = (ROOT / "docs/how-to/fit-a-latent-model.md").read_text("utf-8")
    section = guide.split("## From a record to C code\n")[1].split("\n## ")[0]
    (script,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True)
    commands = re.findall(r"^    ((?:islands|gcc) .*)", section, re.MULTILINE)
    assert [each.split()[:2] for each in commands[:2]] == [["islands", "identify"], ["islands", "show"]]
    for command in commands:
        serial = " --engine serial" if "identify" in command else ""
        program = str(ISLANDS) if command.startswith("islands") else "gcc"
        words = [program, *shlex.split(command + serial)[1:]]
        subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "valve.o").exists()
    summary = " ".join((tmp_path / "valve" / "summary.txt").read_text().split())
    stated = [float(each) for each in re.findall(r"time constant ([\d.]+)", summary)]
    # Poles of 0.9 and 0.8 at a sampling time of 0.1 s.
    assert stated == pytest.approx([-0.1 / np.log(0.9), -0.1 / np.log(0.8)], rel=0.02)
    assert "size 13" in summary
