"""Whatever a command writes, `load` opens, and its simulation is that of ``islands simulate``."""

import csv
import json

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.facade.results.saved_simulation import SavedDiagnosis, SavedSimulation
from islands.persistence.models import write_model
from islands.records.writer import write_record
from islands.systems.published_models import PUBLISHED
from support.command_line import fail, succeed
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.simulated_records import EQUATIONS
from support.undrawn import undrawn_figures

COLUMNS = ("--input", "u_V", "--output", "y_um")
LINEAR = ("--library", "polynomial", "--degree", "1", "--set", "certificate=0")
SEARCH = (
    *("--preset", "narx", "--set", "population=20", "--generations", "2", "--islands", "1"),
    *("--max-terms", "3"),
)


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """Folder with a record of a linear system that has offsets, and one of a system with two outputs."""
    folder = tmp_path_factory.mktemp("load")
    rng = np.random.default_rng(0)
    u = lfilter([0.1], [1.0, -0.9], rng.standard_normal(300))
    y = 7.0 + lfilter([0.3], [1.0, -0.7], np.roll(u, 3)) + 0.02 * rng.standard_normal(300)
    write_record(islands.Dataset(u[:, None] + 2.0, y, 0.01, ("u_V",), "y_um"), folder / "r.csv")
    masses = make_coupled_record(TWO_MASSES, samples=150)
    with (folder / "masses.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t_s", "u", "y1", "y2"])
        writer.writerows(np.column_stack([masses.records[0].time, masses.records[0].u, masses.y]).tolist())
    return folder


def read(base):
    return islands.read_record(base / "r.csv", "u_V", "y_um")


def command(*arguments, out):
    """Return the columns that ``islands simulate`` writes, without the time."""
    succeed("simulate", *arguments, "--out", out)
    return np.genfromtxt(out, delimiter=",", skip_header=1)[:, 1:].T


def bands_of(found, record, level):
    band = found.bands(record, level)
    return band.y, band.lower, band.upper


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("fit", ("--set", "detrend=constant", *LINEAR, "--max-terms", "3")),
        ("fit", ("--set", "decimate=4", "--set", "feedthrough=yes", *LINEAR, "--max-terms", "3")),
        ("identify", SEARCH),
    ],
)
def test_a_result_simulates_as_the_command(base, tmp_path, name, arguments):
    folder, out = tmp_path / "result", tmp_path / "s.csv"
    with undrawn_figures():
        succeed(name, base / "r.csv", *COLUMNS, *arguments, "--out", folder)
    record, loaded = read(base), islands.load(folder)
    assert isinstance(loaded, islands.Result)
    for mode in ("free-run", "shooting", "one-step"):
        (printed,) = command(folder, base / "r.csv", "--mode", mode, out=out)
        np.testing.assert_array_equal(loaded.simulate(record, mode).y, printed)
    last = islands.load(folder / "models" / f"{len(loaded.models):02d}.json")
    assert last.metrics == loaded.models[-1].metrics
    printed = command(folder / "models" / f"{last.rank:02d}.json", base / "r.csv", "--bands", "0.8", out=out)
    np.testing.assert_array_equal(bands_of(last, record, 0.8), printed)
    assert loaded.export("c") == succeed("show", folder, "--format", "c")


@pytest.mark.nightly
def test_a_diagnosis_simulates_as_the_command(base, tmp_path):
    folder, out = tmp_path / "diagnosis", tmp_path / "s.csv"
    succeed("diagnose", base / "r.csv", *COLUMNS, "--simulation", "linear:1", "--out", folder)
    (printed,) = command(folder, base / "r.csv", out=out)
    for path, kind in ((folder, SavedDiagnosis), (folder / "extended.json", SavedSimulation)):
        loaded = islands.load(path)
        assert isinstance(loaded, kind)
        np.testing.assert_array_equal(loaded.simulate(read(base)).y, printed)
        assert loaded.export("json") == (folder / "extended.json").read_text()
    assert islands.load(folder).verdict == "named"
    (folder / "extended.json").unlink()
    message = "has no extended simulation, because the verdict of the diagnosis is 'named'"
    with pytest.raises(islands.ModelError, match=message):
        islands.load(folder).simulate(read(base))
    assert message in fail("simulate", folder, base / "r.csv")


def test_a_model_file_starts_after_its_lags_and_has_no_bands(base, tmp_path):
    model = islands.make_model([(islands.parse("y(k-2)"), 0.5)], ("u_V",), "y_um", 0.01)
    write_model(model, tmp_path / "m.json")
    loaded = islands.load(tmp_path / "m.json")
    assert (loaded.model, loaded.warm_up, loaded.rank) == (model, 2, None)
    (printed,) = command(tmp_path / "m.json", base / "r.csv", out=tmp_path / "s.csv")
    np.testing.assert_array_equal(loaded.simulate(read(base)).y, printed)
    with pytest.raises(islands.ModelError, match="this model file has no prediction bands"):
        loaded.bands(read(base))
    assert repr(loaded).startswith("<FittedModel: y_um(k) =")
    assert "</math>" in loaded._repr_html_()


def test_published_models_and_equations_are_named_as_on_the_command_line():
    assert islands.load("published:12").model == PUBLISHED["12"].model
    simulation = islands.load(f"ode:{EQUATIONS / 'second-order.toml'}")
    assert (simulation.column_names, simulation.output_name) == (("F",), "x")
    with pytest.raises(islands.ModelError, match="give a model or an extended"):
        simulation.export()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "there is no file or folder"),
        ('{"schema": "islands.checkpoint/1"}', "holds no model, result or simulation"),
        ("[1]", "holds no model, result or simulation"),
        ('{"schema": "islands.model/1", ', "cannot be read"),
        ("t_s,u,y\n0,1,2\n", "cannot be read"),
        ('{"schema": "islands.discrepancy/1"}', "is damaged: it has no verdict"),
    ],
)
def test_unknown_and_damaged_files_list_the_kinds(tmp_path, text, message):
    file = tmp_path / "file.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(islands.ModelError, match=message) as caught:
        islands.load(file)
    assert "a result folder, a model file, the folder of a diagnosis, an extended.json" in str(caught.value)


def test_a_folder_of_something_else_lists_the_kinds(tmp_path):
    with pytest.raises(islands.ModelError, match=r"has no discrepancy.json, .*: give a result folder"):
        islands.load(tmp_path)


def test_a_damaged_model_names_the_field(base, tmp_path):
    search = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0, "average": 1}
    islands.fit(read(base), estimator="shooting", **search).save(tmp_path / "result", figures=())
    file = tmp_path / "result" / "models" / "01.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"inputs": []}))
    with pytest.raises(islands.ModelError, match="inputs"):
        islands.load(file)
    with pytest.raises(islands.ModelError, match="inputs"):
        islands.load(tmp_path / "result")
