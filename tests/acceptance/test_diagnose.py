"""Command ``islands diagnose``: result document, report, self-test and rejected options."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from support.command_line import fail, succeed, write_offset
from support.undrawn import undrawn_figures

OPTIONS = ("--input", "u_V", "--output", "y_um", "--simulation", "column:theirs_um")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short record, a recorded simulation that lacks its offset, and the diagnosis without figures."""
    base = tmp_path_factory.mktemp("diagnosis")
    write_offset(base / "record.csv")
    with undrawn_figures():
        # Other processes would draw the figures.
        succeed("diagnose", base / "record.csv", *OPTIONS, "--workers", "1", "--out", base / "out")
    return base


def test_diagnose_names_the_missing_effect(folder: Path) -> None:
    document = json.loads((folder / "out/discrepancy.json").read_text())
    assert document["verdict"] == "named"
    (effect,) = document["effects"]
    assert effect["name"] == "offset"
    assert effect["parameters"]["c"]["unit"] == "um"
    low, high = effect["parameters"]["c"]["ci95"]
    assert low < 0.3 < high
    assert document["gain"]["reduction_percent"] > 20
    assert document["gain"]["after"]["rmse"] < document["gain"]["before"]["rmse"]
    assert set(document["gain"]["noise_floor"]) == {"rmse", "mape"}
    assert document["candidates"][0]["name"] == "offset"
    assert document["wall_s"] > 0
    for name in ("detection_limits", "false_alarm_rate", "p_value", "confusion"):
        assert document[name] is None
    extended = json.loads((folder / "out" / document["extended_model"]).read_text())
    assert [each["name"] for each in extended["effects"]] == ["offset"]


def test_report_is_a_single_file_with_a_summary(folder: Path) -> None:
    text = (folder / "out/report.html").read_text()
    assert "offset of the output (<code>offset</code>): c = " in text
    assert "On the last quarter of the record, excluded from fitting" in text
    assert text.count("<img ") == 3
    assert not re.findall(r'(?:src|href)="(?!data:)', text)


@pytest.mark.nightly
def test_an_exact_simulation_of_a_slow_output_has_no_discrepancy(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-1.0, 1.0, 150), 40)
    decay = np.exp(-0.01 / 0.15)
    exact = lfilter([0.0, 1.0 - decay], [1.0, -decay], u)
    y = exact + 0.01 * rng.standard_normal(6000)
    cells = [f"{y[k]:.5f}" if k % 10 == 0 else "" for k in range(6000)]
    rows = [f"{0.01 * k:.2f},{u[k]:.5f},{exact[k]:.5f},{cells[k]}" for k in range(6000)]
    (tmp_path / "r.csv").write_text("\n".join(["t_s,u_V,theirs_um,y_um", *rows]) + "\n")
    with undrawn_figures():
        text = succeed(
            *("diagnose", tmp_path / "r.csv", "--input", "u_V", "--output", "y_um"),
            *("--simulation", "column:theirs_um", "--out", tmp_path / "out"),
        )
    assert text.startswith("No significant discrepancy")
    reading = "Reading: columns have samples at different times: u_V in every row, theirs_um in every row"
    assert reading in " ".join(text.split())


@pytest.mark.ci
def test_file_for_validation_is_held_out_as_a_whole(folder: Path) -> None:
    other = folder / "validation.csv"
    header, *lines = write_offset(other).read_text().splitlines()
    other.write_text("\n".join([header, *lines[300:]]))
    options = (*OPTIONS, "--rows", "0:300")
    with undrawn_figures():
        succeed(
            *("diagnose", folder / "record.csv", "--validation", other, *options),
            *("--out", folder / "held"),
        )
    document = json.loads((folder / "held/discrepancy.json").read_text())
    assert document["record"]["segments"] == [300, 100]
    assert "On the validation recording, excluded from fitting" in (folder / "held/report.html").read_text()
    planned = fail("diagnose", other, *options, "--plan", "--validation", other, "--out", folder / "p")
    assert "--validation is for a diagnosis" in planned


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--simulation", "pendulum"), "unknown simulation 'pendulum': take one of bouc-wen-piezo"),
        (("--simulation", "bouc-wen-piezo:none.json"), "none.json cannot be read as JSON"),
        (("--simulation", "model:none.json"), "none.json"),
        (("--simulation", "column:y_sim"), "no column y_sim"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "dp"), "tolerance is NAME=VALUE"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "mass=0.1"), "has no parameter 'mass'"),
        (("--simulation", "bouc-wen-piezo", "--input", "theirs_um"), "is driven by one input"),
        (("--simulation", "bouc-wen-piezo", "--noise-level", "0"), "noise_level is a number above 0"),
    ],
)
def test_invalid_option_is_rejected_with_a_one_line_message(
    folder: Path, options: tuple[str, ...], message: str
) -> None:
    text = fail("diagnose", folder / "record.csv", *OPTIONS, *options, "--out", folder / "other")
    assert message in text
    assert "Traceback" not in text
    assert not (folder / "other").exists()
