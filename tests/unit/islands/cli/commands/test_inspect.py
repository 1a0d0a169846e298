import json

import pytest

from support.command_line import fail, succeed, write_hysteresis


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return write_hysteresis(tmp_path_factory.mktemp("inspect") / "record.csv")


@pytest.mark.ci
def test_json_is_the_document(record):
    document = json.loads(succeed("inspect", record, "--json"))
    assert document["choice"]["output"] == "y_um"
    rest = next(fact for fact in document["facts"] if fact["name"] == "rest")
    assert set(rest) == {"name", "signal", "value", "unit", "interval", "confidence", "sentence"}


@pytest.mark.ci
def test_the_folder_has_text_document_and_figures(record, tmp_path):
    succeed("inspect", record, "--out", tmp_path / "found")
    names = {path.name for path in (tmp_path / "found").iterdir()}
    assert names == {"inspection.json", "inspection.txt", "overview.svg", "overview-dark.svg"}


def test_an_unreadable_file_is_an_error_of_one_line(tmp_path):
    assert "there is no file" in fail("inspect", tmp_path / "none.csv")
