"""The commands fit, simulate, show and systems: files, numbers, messages."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from islands.records.writer import write_record
from islands.systems.bouc_wen import consistent_estimation, consistent_validation
from support.command_line import fail, succeed
from support.undrawn import undrawn_figures

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of the consistent piezo for estimation, and three for validation."""
    base = tmp_path_factory.mktemp("piezo")
    write_record(consistent_estimation(4, 6.0), base / "long.csv")
    write_record(consistent_validation(3.0), base / "sine.csv")
    return base


def fit(base: Path, out: str) -> None:
    succeed(
        *("fit", base / "long.csv", "--input", "u_V", "--output", "y_um", "--rows", "0:5000"),
        *("--validation", base / "sine.csv", "--library", "phi-polynomial", "--max-terms", 6),
        *("--figures", "all", "--out", base / out),
    )


@pytest.fixture(scope="module")
def folder(records: Path) -> Path:
    """The records, and the result of ``islands fit`` on the first 5 s, with empty figures."""
    with undrawn_figures():
        fit(records, "fit")
    return records


@pytest.fixture(scope="module")
def result(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "fit" / "result.json").read_text())


def test_folder_contains_models_figures_and_a_summary(folder: Path, result: dict[str, Any]) -> None:
    for model in result["models"]:
        document = json.loads((folder / "fit" / "models" / f"{model['rank']:02d}.json").read_text())
        terms = [{**term} for term in model["terms"]]
        assert all(0.0 <= term.pop("inclusion") <= 1.0 for term in terms)
        assert all(re.search(r"\b(y_um|u_V)\(k-\d\)", term.pop("term")) for term in terms)
        assert document["terms"] == terms
    figures = {path.stem for path in (folder / "fit" / "figures").glob("*.svg")}
    assert figures == {"free-run", "loop", "hold", "residuals", "record", "front"}
    assert f"model 1 of {len(result['models'])}" in " ".join(
        (folder / "fit" / "summary.txt").read_text().split()
    )


def assert_same_files(one: Path, other: Path) -> None:
    """Check that two results are bit-identical except for ``result.json``, which contains times."""
    paths = [path for path in sorted(one.rglob("*")) if path.is_file() and path.name != "result.json"]
    assert len(paths) > 8
    for path in paths:
        assert path.read_bytes() == (other / path.relative_to(one)).read_bytes(), path.name


def test_repeated_fit_gives_bit_identical_models(folder: Path) -> None:
    with undrawn_figures():
        fit(folder, "again")
    assert_same_files(folder / "fit", folder / "again")


@pytest.mark.parametrize(("mode", "missing"), [("one-step", 3), ("shooting", 3), ("free-run", 3)])
def test_simulate_writes_a_row_for_every_sample(folder: Path, mode: str, missing: int) -> None:
    out = folder / f"{mode}.csv"
    text = succeed(
        "simulate", folder / "fit/models/01.json", folder / "sine.csv", "--mode", mode, "--out", out
    )
    assert "ok" in text
    table = np.genfromtxt(out, delimiter=",", names=True)
    assert table.dtype.names == ("time", "y_sim")
    assert len(table) == 3_000
    assert np.isnan(table["y_sim"][:missing]).all()
    assert np.isfinite(table["y_sim"][missing:]).all()
    measured = np.genfromtxt(folder / "sine.csv", delimiter=",", names=True)
    assert np.array_equal(table["time"], measured["t_s"])
    assert np.abs(table["y_sim"] - measured["y_um"])[missing:].max() < 2.0


def test_a_free_run_needs_no_output_after_its_warm_up(folder: Path) -> None:
    with (folder / "sine.csv").open() as stream:
        rows = list(csv.reader(stream))
    for row in rows[11:]:
        row[2] = ""
    with (folder / "blind.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows(rows)
    model = folder / "fit/models/01.json"
    succeed("simulate", model, folder / "blind.csv", "--mode", "free-run", "--out", folder / "blind-run.csv")
    succeed("simulate", model, folder / "sine.csv", "--mode", "free-run", "--out", folder / "seen-run.csv")
    assert (folder / "blind-run.csv").read_text() == (folder / "seen-run.csv").read_text()
    assert "missing at sample 10" in fail("simulate", model, folder / "blind.csv", "--mode", "one-step")


def test_errors_say_what_to_do_and_keep_existing_results(folder: Path) -> None:
    record, out = folder / "sine.csv", folder / "never"
    base = ["fit", record, "--output", "y_um", "--out", out]
    assert "u_mV" in fail(*base, "--input", "u_mV")
    assert "library is one of" in fail(*base, "--input", "u_V", "--library", "fourier")
    assert "unknown constraints" in fail(*base, "--input", "u_V", "--constraints", "physics")
    assert "fewer lags" in fail(
        *base, "--input", "u_V", "--library", "polynomial", "--degree", 5, "--lags", 11
    )
    assert "--validation" in fail(*base, "--input", "u_V", "--validation", "nowhere.csv")
    assert "START:STOP" in fail(*base, "--input", "u_V", "--rows", "all")
    assert not out.exists()
    before = (folder / "fit/result.json").read_bytes()
    message = fail("fit", record, "--input", "u_V", "--output", "y_um", "--out", folder / "fit")
    assert "--force" in message
    assert (folder / "fit/result.json").read_bytes() == before
    assert "unknown published model" in fail("show", "published:15")
    assert "there is no file or folder" in fail("show", folder / "nothing.json")
    (folder / "other.json").write_text("{}")
    assert "holds no model, result or simulation" in fail("show", folder / "other.json")
    assert "unknown system 'pendulum': take one of bouc-wen-piezo" in fail(
        "examples", folder / "p.csv", "--system", "pendulum"
    )
