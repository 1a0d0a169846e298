import numpy as np
import pytest

import islands
from islands.records.signal_map import match_rate
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from support.command_line import succeed
from support.exported_programs import run_c
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
    steps = (
        "--set",
        "decimate=4",
        "--set",
        "detrend=constant",
        "--set",
        "average=1",
        "--set",
        "feedthrough=no",
    )
    with undrawn_figures():
        succeed("fit", record, *columns, *steps, "--max-terms", "4", "--out", folder / "out")
    return folder


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


def run_python(best, data):
    program = {}
    exec(best.export("python"), program)
    return np.array(program["simulate"](data.u[:, 0], data.y))


def simulate_for_diagnosis(best, data, folder):
    """Return the simulation of a diagnosis and of a monitor, of a record at the rate of the model."""
    simulator = make_simulator(f"model:{folder / 'out' / 'models'}/{best.rank:02d}.json", data)
    alone = ExtendedSimulator(simulator, (), make_context(data, simulator, data.samples))
    return alone.simulate(alone.nominal)


@pytest.mark.parametrize("path", ["read_result", "written again", "python", "c", "diagnosis"])
def test_every_path_from_a_folder_gives_the_output_of_the_command(folder, tmp_path, path):
    record = write(folder / "third.csv", 2, offset=0.3)
    succeed("simulate", folder / "out", record, "--out", tmp_path / "sim.csv")
    expected = np.genfromtxt(tmp_path / "sim.csv", delimiter=",", skip_header=1)[:, 1]
    best, whole = islands.read_result(folder / "out").best, islands.read_record(record, "u_V", "y_um")
    data = match_rate(best.model, whole)
    islands.write_model(best.model, tmp_path / "model.json")
    found = {
        "read_result": lambda: best.simulate(whole).y,
        "written again": lambda: (
            islands.simulate(islands.read_model(tmp_path / "model.json"), whole, warm_up=best.warm_up).y
        ),
        "python": lambda: run_python(best, data),
        "c": lambda: run_c(best.model, data, tmp_path),
        "diagnosis": lambda: simulate_for_diagnosis(best, data, folder),
    }[path]()
    first = len(found) - np.isfinite(expected).sum()
    # Programs start from the largest lag; the file leaves out the samples before the first prediction.
    assert best.warm_up == best.model.maximum_lag
    np.testing.assert_allclose(found[first:], expected[np.isfinite(expected)], rtol=1e-9)
