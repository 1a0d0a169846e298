"""Command line in this process: parsing of options, output folders, and errors."""

import json
import os
import shutil
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from islands.cli.output_folder import check_folder
from islands.errors import IslandsError, SettingsError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.persistence.models import write_model
from islands.records.dataset import Dataset
from islands.records.reading.row_range import parse_rows
from islands.records.writer import write_record
from support.command_line import succeed
from support.undrawn import undrawn_figures


def record(samples=120, seed=0):
    rng = np.random.default_rng(seed)
    u, y = 0.1 * np.cumsum(rng.normal(size=samples)), np.zeros(samples)
    for k in range(3, samples):
        y[k] = y[k - 1] + 0.8 * (u[k - 1] - u[k - 2]) - 0.3 * y[k - 1] * abs(u[k - 1] - u[k - 2])
    return Dataset(u, y + 0.001 * rng.normal(size=samples), 0.01, ("u_V",), "y_um")


@pytest.fixture(scope="module", autouse=True)
def undrawn():
    """Write empty figures; their content is tested elsewhere."""
    with undrawn_figures():
        yield


@pytest.fixture
def run(command_line):
    """Run a command in a temporary folder; return exit code, standard output, standard error."""
    return command_line


FIT = (
    *("fit", "r.csv", "--input", "u_V", "--output", "y_um", "--out", "out"),
    *("--library", "phi-polynomial", "--max-terms", "3"),
)


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """Folder with a record and the result of a fit, and the output of the command."""
    folder = tmp_path_factory.mktemp("fit")
    write_record(record(), folder / "r.csv")
    with chdir(folder):
        return folder, succeed(*FIT)


@pytest.fixture
def fitted(fit, run):
    """Output of the fit; the test runs in a copy of its folder."""
    folder, printed = fit
    shutil.copytree(folder, Path.cwd(), dirs_exist_ok=True)
    return printed


# Options.


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, None),
        ("0:5000", slice(0, 5000)),
        ("100:", slice(100, None)),
        (":100", slice(None, 100)),
        ("-200:", slice(-200, None)),
    ],
)
def test_rows_are_start_and_stop(text, expected):
    assert parse_rows(text) == expected


@pytest.mark.parametrize("text", ["5", "a:b", "1:2:3", "", "1.5:3"])
def test_malformed_rows_are_rejected(text):
    with pytest.raises(SettingsError) as caught:
        parse_rows(text)
    assert str(caught.value) == f"cannot read the rows {text!r}: write START:STOP, for example 0:5000"


# Output folders.


def test_result_is_replaced_only_with_force(tmp_path):
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(SettingsError, match="holds a result already: give another --out, or --force"):
        check_folder(tmp_path, force=False)
    check_folder(tmp_path, force=True)


def test_folder_below_a_file_is_rejected(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for path in (file, file / "out", file / "out" / "deeper"):
        with pytest.raises(SettingsError) as caught:
            check_folder(path, force=True)
        assert str(caught.value) == f"--out {path}: {file} is a file, give a folder"


def test_read_only_folder_is_rejected(tmp_path, monkeypatch):
    # The user that runs the tests may have all permissions, so the check is replaced.
    monkeypatch.setattr(os, "access", lambda path, _mode: Path(path) != tmp_path)
    with pytest.raises(SettingsError, match=r"is not writable, give another folder"):
        check_folder(tmp_path / "out", force=False)


# Commands.


def test_fit_prints_the_models_and_the_output_folder(fitted):
    out = fitted
    evaluations = json.loads(Path("out/result.json").read_text())["search"]["evaluations"]
    method = Path("out/method.txt").read_text()
    assert method.startswith("120 samples, 0.01 s: u_V to y_um\n")
    assert f"{evaluations} models estimated: {evaluations} ok" in method
    assert "out/: result.json, models/, figures/, summary.txt, method.txt" in out
    assert Path("out/summary.txt").read_text() in out
    assert json.loads(Path("out/result.json").read_text())["search"]["wall_s"] > 0.0


def test_simulate_writes_prediction_bands(run, fitted):
    arguments = ("simulate", "out", "r.csv", "--out", "s.csv", "--bands")
    code, out, _ = run(*arguments, "0.9")
    assert code == 0
    assert "90 % band: median half-width" in out
    header, *rows = Path("s.csv").read_text().splitlines()
    assert header == "time,y_sim,y_low,y_high"
    numbers = [tuple(map(float, row.split(",")[1:])) for row in rows[3:]]
    assert all(low <= simulated <= high for simulated, low, high in numbers)
    for changes, reason in (
        (("0.2",), "between 0.5 and 0.99"),
        (("0.9", "--mode", "one-step"), "free runs of models of a result folder"),
    ):
        code, _, error = run(*arguments, *changes)
        assert (code, reason in error) == (2, True)


def test_a_model_file_alone_has_the_bands_of_its_result(run, fitted):
    succeed("show", "out", "--format", "json", "--out", "model.json")
    rank = json.loads(Path("out/result.json").read_text())["recommended"]["rank"]
    assert Path("model.json").read_text() == Path(f"out/models/{rank:02d}.json").read_text()
    bands = ("r.csv", "--bands", "0.9", "--set", "warm_up=5")
    outputs = [run("simulate", name, *bands)[1] for name in ("out", "model.json")]
    widths = [each.partition("median half-width")[2].split()[0] for each in outputs]
    assert widths[0] == widths[1]
    document = json.loads(Path("model.json").read_text())
    del document["uncertainty"]
    Path("bare.json").write_text(json.dumps(document))
    code, _, error = run("simulate", "bare.json", "r.csv", "--bands", "0.9")
    assert (code, "this model file has no prediction bands" in " ".join(error.split())) == (2, True)


@pytest.mark.parametrize("name", ["u_V", "u_V+1"])
def test_simulate_averages_a_record_for_a_model_of_means(run, name):
    model = make_model([(parse("u(k-1)"), 2.0)], (name,), "y_um", 0.04)
    write_model(replace(model, average=4), "model.json")
    write_record(record(), "r.csv")
    code, out, _ = run("simulate", "model.json", "r.csv", "--out", "s.csv")
    stated = "as in the model, k counts steps of 0.04 s: each value is the mean of 4 samples of the record"
    assert (code, " ".join(out.split()).startswith(stated)) == (0, True)
    time, simulated = np.loadtxt("s.csv", delimiter=",", skiprows=2, unpack=True)
    means = 2.0 * record().u[:, 0].reshape(-1, 4).mean(axis=1)
    assert simulated == pytest.approx(means[:-1] if name == "u_V" else means[1:])
    assert time == pytest.approx(0.015 + 0.04 * np.arange(1, 30))


def test_simulate_takes_a_record_whose_output_has_its_first_values_only(run, fitted):
    lines = Path("r.csv").read_text().splitlines()
    started = (line if place < 8 else line.rpartition(",")[0] + "," for place, line in enumerate(lines))
    Path("inputs.csv").write_text("\n".join(started))
    code, out, _ = run("simulate", "out", "inputs.csv", "--bands", "0.9", "--out", "s.csv")
    assert (code, "nan" in out) == (0, False)
    assert "y_um is measured in 4 of the simulated samples: too few for an error" in out
    assert np.isfinite(np.loadtxt("s.csv", delimiter=",", skiprows=4)).all()


def test_simulate_takes_records_of_inputs_alone(run, fitted):
    lines = Path("r.csv").read_text().splitlines()
    for name, kept in (("one.csv", 60), ("two.csv", 40)):
        Path(name).write_text("\n".join(line.rpartition(",")[0] for line in lines[:kept]))
    code, _, error = run("simulate", "out", "one.csv")
    # A model of hysteresis rests at any output.
    assert (code, "give the output y, as --start y_um=VALUE" in " ".join(error.split())) == (2, True)
    code, out, _ = run("simulate", "out", "one.csv", "two.csv", "--start", "y_um=0.25", "--out", "both")
    assert code == 0
    assert out.count("free-run from y_um = 0.25: ok") == 2
    one, two = (np.loadtxt(f"both/{name}.csv", delimiter=",", skiprows=1) for name in ("one", "two"))
    assert one[: len(two)].tolist() == two.tolist()
    code, _, error = run("simulate", "out", "one.csv", "--start", "x=1")
    assert (code, "the start of x: the model has y_um" in error) == (2, True)
    code, _, error = run("simulate", "out", "one.csv", "--bands", "0.9")
    assert (code, "--bands need the measured output" in error) == (2, True)


def test_no_simulation_of_several_records_replaces_that_of_another(run, fitted):
    for folder in ("monday", "tuesday"):
        Path(folder).mkdir()
        shutil.copyfile("r.csv", f"{folder}/r.csv")
    code, _, error = run("simulate", "out", "monday/r.csv", "tuesday/r.csv", "--out", "both")
    assert (code, Path("both").exists()) == (2, False)
    assert "monday/r.csv and tuesday/r.csv would both be simulated to both/r.csv" in " ".join(error.split())


def test_the_record_of_a_system_is_written_into_a_folder_with_brackets(run):
    Path("[red]").mkdir()
    code, out, _ = run("examples", "[red]/a[b].csv", "--system", "s1")
    assert code == 0
    assert out.startswith("[red]/a[b].csv: 500 samples\n")


def test_an_export_is_written_to_a_file(run, tmp_path):
    for kind in ("c", "fmu"):
        assert run("show", "published:12", "--format", kind, "--out", str(tmp_path / kind)) == (0, "", "")
    assert (tmp_path / "c").read_text() == run("show", "published:12", "--format", "c")[1]
    assert (tmp_path / "fmu").read_bytes().startswith(b"PK")


# Errors: one line that says what to do, and no traceback.


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "[/red]"), "there is no file or folder [/red]"),
        (("show", "y[k-1].json"), "there is no file or folder y[k-1].json"),
        (("show", "published:12", "--format", "[bold]"), "unknown format '[bold]'"),
        (("show", "published:12", "--format", "fmu"), "the format fmu is not text: write a file with --out"),
        (("simulate", "published:12", "nowhere.csv"), "there is no file nowhere.csv"),
        (("examples", "no/where.csv", "--system", "s1"), "cannot write no/where.csv: No such file"),
    ],
)
def test_error_message_with_brackets_is_printed_verbatim(run, arguments, message):
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert message in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (IslandsError("take less"), 2, "error: take less"),
        (PermissionError(13, "Permission denied", "out"), 2, "error: [Errno 13] Permission denied: 'out'"),
        (OSError(28, "No space left on device"), 2, "error: [Errno 28] No space left on device"),
    ],
)
def test_deliberate_error_is_printed_as_a_message(run, monkeypatch, error, code, message):
    def stop(*_):
        raise error

    monkeypatch.setattr("islands.cli.commands.show.term_table", stop)
    found, _, err = run("show", "published:12")
    assert found == code
    assert err.strip() == message


def test_interrupt_exits_with_code_130(run, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("islands.cli.commands.show.term_table", stop)
    code, _, err = run("show", "published:12")
    assert code == 130
    assert "Traceback" not in err
