"""Several outputs on the command line: fitted, simulated and shown; errors name the option."""

import csv
import json

import numpy as np
import pytest

from support.command_line import fail, succeed
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.parsed_files import list_parsed
from support.undrawn import undrawn_figures

#: A search that takes a second.
SMALL = ("--lags", "2", "--degree", "1", "--max-terms", "4", "--set", "certificate=0", "--set", "average=1")
COLUMNS = ("--input", "u", "--output", "y1,y2")


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("record") / "masses.csv"
    data = make_coupled_record(TWO_MASSES, samples=150)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t_s", "u", "y1", "y2"])
        times = (0.1 * np.arange(data.samples)).round(3)
        writer.writerows(np.column_stack([times, data.records[0].u, data.y]).tolist())
    return path


@pytest.mark.ci
def test_a_fitted_model_is_simulated_and_shown(record, tmp_path, monkeypatch) -> None:
    folder = tmp_path / "result"
    with undrawn_figures():
        printed = succeed("fit", record, *COLUMNS, *SMALL, "--out", folder)
    assert "* y2(k-1)" in printed
    assert json.loads((folder / "result.json").read_text())["schema"] == "islands.result/1"
    out = tmp_path / "simulated.csv"
    parsed = list_parsed(monkeypatch)
    printed = succeed("simulate", folder, record, "--out", out)
    assert parsed == ["masses.csv"]
    assert "y1: MAPE 0.0000 %  R2 1.00000" in printed
    header, *rows = csv.reader(out.read_text().splitlines())
    assert header == ["time", "y1_sim", "y2_sim"]
    assert len(rows) == 150
    printed = succeed("simulate", folder, record, "--bands", 0.9, "--out", out)
    assert "y2: 90 % band: median half-width" in printed
    assert out.read_text().splitlines()[0] == "time,y1_sim,y2_sim,y1_low,y1_high,y2_low,y2_high"
    for kind, start in (("plain", "y1(k) ="), ("c", "/*"), ("json", "{")):
        assert succeed("show", folder, "--format", kind).startswith(start)
    succeed("show", folder, "--format", "fmu", "--out", tmp_path / "masses.fmu")
    assert (tmp_path / "masses.fmu").read_bytes()[:2] == b"PK"
    assert "write a file with --out" in fail("show", folder, "--format", "fmu")
    assert "y1: MAPE 0.0000 %" in succeed("simulate", folder, record, "--mode", "one-step")
    succeed("show", folder, "--figure", "free-run", "--record", record, "--out", tmp_path / "runs.svg")
    assert "y2" in (tmp_path / "runs.svg").read_text()
    assert "as many --output" in fail("simulate", folder, record, "--output", "y1")


@pytest.mark.ci
def test_a_run_that_its_wall_time_has_ended_is_resumed_to_the_whole_result(record, tmp_path) -> None:
    # Without a library there are no seeds, which take most of the time.
    settings = ("--preset", "paper-appendix", "--set", "population=20", "--generations", 1, "--max-terms", 3)
    whole, part = tmp_path / "whole", tmp_path / "part"
    with undrawn_figures():
        assert "y2, error: RMSE" in succeed("identify", record, *COLUMNS, *settings, "--out", whole)
        succeed("identify", record, *COLUMNS, *settings, "--wall-time", 1e-9, "--out", part)
        searches = [
            json.loads((part / "outputs" / name / "result.json").read_text())["search"]
            for name in ("1-y1", "2-y2")
        ]
        assert [search["ended_by"] for search in searches] == ["stopped", "stopped"]
        succeed("identify", "--resume", part, "--engine", "serial")
    assert (part / "models" / "01.json").read_bytes() == (whole / "models" / "01.json").read_bytes()


@pytest.mark.parametrize(
    ("command", "options", "message"),
    [
        ("fit", ("--output", "y1", "--output", "y1"), "y1 is given twice"),
        ("fit", ("--output", "y1", "--output", "u"), "u is an input and an output"),
        ("fit", ("--output", "y1,y2", "--constraints", "gain = 2"), "are for one output"),
        ("fit", ("--output", "y1,y2", "--set", "feedthrough=yes"), "as u+1"),
        ("fit", ("--output", "y1,y2", "--model", "latent", "--lags", "3"), "are settings of NARX models"),
        ("identify", ("--output", "y1,y2", "--test", "120:150"), "other samples for estimation"),
        ("identify", ("--output", "y1,y1"), "y1 is given twice"),
    ],
)
def test_options_for_one_output_are_refused(record, tmp_path, command, options, message) -> None:
    assert message in fail(command, record, "--input", "u", *options, "--out", tmp_path / "result")
    assert not (tmp_path / "result").exists()
