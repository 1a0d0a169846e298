"""Report of a result folder."""

import json
import re

import pytest

import islands
from islands.errors import ModelError
from islands.report.pages.identification import report_saved_result
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.identifications import record

pytestmark = pytest.mark.ci

SETTINGS = {"library": "polynomial", "degree": 1, "max_terms": 2, "certificate": 0, "average": 1}


@pytest.fixture
def folder(tmp_path):
    return islands.fit(record(300), lags=1, **SETTINGS).save(tmp_path / "result", figures=())


def test_report_of_a_folder_has_its_name_its_day_and_its_figures(folder):
    (folder / "figures").mkdir()
    (folder / "figures/free-run.svg").write_bytes(b"<svg/>")
    page = report_saved_result(folder).decode()
    assert "<title>result</title>" in page
    assert re.search(r'class="origin"><bdi>result</bdi> · \d{4}-\d\d-\d\d · islands ', page)
    assert page.count("<img ") == 1
    assert report_saved_result(folder / "result.json") == report_saved_result(folder)


def test_report_of_several_outputs_has_the_equations_and_the_free_run_of_each(tmp_path):
    data = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    result = islands.fit(data, **SETTINGS)
    result.save(tmp_path, figures=())
    (tmp_path / "figures").mkdir()
    for number in (1, 2):
        (tmp_path / f"figures/free-run-{number}.svg").write_bytes(b"<svg/>")
    page = report_saved_result(tmp_path).decode()
    assert "terms simulates y1 with a mean absolute error" in page
    assert page.count("<img ") == 2
    assert report_saved_result(tmp_path, result.best.linear_system).decode().count("<img ") == 5


def test_report_of_a_diagnosis_is_the_one_that_it_wrote(tmp_path):
    (tmp_path / "discrepancy.json").write_text('{"schema": "islands.discrepancy/1"}')
    with pytest.raises(ModelError, match="stopped before its report: diagnose again"):
        report_saved_result(tmp_path)
    (tmp_path / "report.html").write_bytes(b"written")
    assert report_saved_result(tmp_path) == b"written"


def test_result_of_another_version_is_refused_with_advice(folder):
    document = json.loads((folder / "result.json").read_text())
    del document["search"]
    (folder / "result.json").write_text(json.dumps(document))
    with pytest.raises(ModelError, match=r"another version: KeyError.*'search'.*identify again"):
        report_saved_result(folder)


def test_model_file_has_no_report(folder):
    with pytest.raises(ModelError, match="is no result: give the folder"):
        report_saved_result(folder / "models/01.json")
