import json

import numpy as np
import pytest

from support.command_line import fail, stored, succeed
from support.undrawn import undrawn_figures


def write(path, seed, offset=0.0):
    """Write a linear system around an operating point, oversampled."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, 60), 40)
    y = np.zeros(u.size)
    for k in range(1, u.size):
        y[k] = 0.98 * y[k - 1] + 0.02 * u[k - 1]
    table = np.column_stack([0.01 * np.arange(u.size), 4.0 + u + offset, 7.0 + 2.0 * (y + offset)])
    np.savetxt(path, table, delimiter=",", header="t_s,u_V,y_um", comments="", fmt="%.12g")
    return path


#: Fits a model.
pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("preprocessing")
    record = write(folder / "r.csv", 0)
    columns = (
        "--input",
        "u_V",
        "--output",
        "y_um",
        "--library",
        "polynomial",
        "--degree",
        "1",
        "--lags",
        "2",
    )
    steps = ("--decimate", "4", "--detrend", "constant", "--average", "1", "--feedthrough", "no")
    with undrawn_figures():
        succeed("fit", record, *columns, *steps, "--max-terms", "4", "--out", folder / "out")
    return folder


def test_result_states_the_steps(folder):
    preprocessing = stored(folder / "out")["preprocessing"]
    assert preprocessing["steps"]["steps"] == {"lowpass": None, "decimate": 4, "detrend": "constant"}
    assert preprocessing["steps"]["output_offset"] == pytest.approx(7.0, abs=0.3)
    assert preprocessing["dt"] == pytest.approx(0.04)


def test_simulation_repeats_the_steps_and_restores_the_offset(folder):
    other = write(folder / "other.csv", 1, offset=0.2)
    printed = succeed("simulate", folder / "out", other, "--out", folder / "sim.csv")
    stated = " ".join(printed.split())
    assert "u_V from" in stated
    assert "one of 4 samples of 0.01 s behind a zero-phase low-pass filter of 10 Hz" in stated
    simulated = np.genfromtxt(folder / "sim.csv", delimiter=",", names=True)
    measured = np.genfromtxt(other, delimiter=",", names=True)
    values = simulated[simulated.dtype.names[1]]
    expected = measured["y_um"][::4]
    assert len(values) == len(expected)
    assert np.nanmax(np.abs(values - expected)[20:-20]) < 0.05


def test_a_result_without_steps_has_none(tmp_path):
    record = write(tmp_path / "r.csv", 0)
    options = ("--input", "u_V", "--output", "y_um", "--max-terms", "2", "--out", tmp_path / "out")
    with undrawn_figures():
        succeed("fit", record, *options)
    assert json.loads((tmp_path / "out" / "result.json").read_text())["preprocessing"]["steps"] is None


def test_wrong_values_are_errors_of_one_line(tmp_path):
    record = write(tmp_path / "r.csv", 0)
    for option, value, words in (("--detrend", "square", "detrend is"), ("--decimate", "0", "decimate is")):
        message = fail(
            "fit", record, "--input", "u_V", "--output", "y_um", option, value, "--out", tmp_path / "out"
        )
        assert words in message
