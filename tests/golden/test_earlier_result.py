"""Result folder of a version whose model files have no preprocessing: ``result.json`` alone has it.

Commit c8c890ce wrote ``earlier_result`` from ``record.csv`` with ``decimate=2, detrend="constant"`` and
``feedthrough="yes"``.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.records.signal_map import match_rate
from islands.validation.metrics import metrics
from support.command_line import succeed

FOLDER = Path(__file__).parent / "earlier_result"


@pytest.fixture(scope="module")
def record():
    return islands.read_record(FOLDER / "record.csv", "u_V", "y_um")


def test_the_model_files_have_no_preprocessing():
    for path in (FOLDER / "models").iterdir():
        assert "preprocessing" not in json.loads(path.read_text(encoding="utf-8"))


def test_every_model_has_the_preprocessing_of_the_result():
    steps = json.loads((FOLDER / "result.json").read_text(encoding="utf-8"))["preprocessing"]["steps"]
    for saved in islands.read_result(FOLDER).models:
        assert saved.model.preprocessing.as_document() == steps
        assert saved.signals.startswith("y is the deviation from 6.9460062 um, u from 3.9751293 V; ")


def test_the_measured_record_has_the_errors_of_the_result(record):
    for saved in islands.read_result(FOLDER).models:
        # The validation data were the last quarter of the decimated record.
        held_out = match_rate(saved.model, record)[90:]
        found = metrics(held_out.y, saved.simulate(held_out).y)
        expected = saved.metrics["validation"]["free_run"]
        assert (found.rmse, found.r2) == pytest.approx((expected.rmse, expected.r2), rel=1e-9)


def test_the_command_gives_the_simulation_of_the_library(record, tmp_path):
    succeed("simulate", FOLDER, FOLDER / "record.csv", "--out", tmp_path / "s.csv")
    found = np.genfromtxt(tmp_path / "s.csv", delimiter=",", skip_header=1)[:, 1]
    expected = islands.read_result(FOLDER).best.simulate(record).y
    np.testing.assert_allclose(found[np.isfinite(found)], expected[np.isfinite(expected)], rtol=1e-9)


def test_a_model_file_outside_of_its_folder_has_signals_of_the_record(tmp_path):
    shutil.copy(FOLDER / "models" / "01.json", tmp_path)
    assert islands.read_model(tmp_path / "01.json").preprocessing is None
