"""The model of a document is the one that `islands.load` opens."""

import json
import shutil
from pathlib import Path

import pytest

import islands
from islands.persistence.models import write_model
from islands.persistence.saved_documents import open_document, read_saved_model
from islands.systems.published_models import get_published_model

EARLIER = Path(__file__).parents[3] / "golden" / "earlier_result"


def test_the_model_of_a_result_is_the_recommended_one(tmp_path):
    assert read_saved_model(open_document(EARLIER)) == islands.load(EARLIER).best.model
    copied = shutil.copytree(EARLIER, tmp_path / "copy")
    document = json.loads((copied / "result.json").read_text())
    last = len(document["models"])
    document["recommended"] = {"rank": last, "reasons": []}
    (copied / "result.json").write_text(json.dumps(document))
    assert last > 1
    assert (
        read_saved_model(open_document(copied)) == islands.load(copied / "models" / f"{last:02d}.json").model
    )


def test_the_model_of_a_file_is_that_model(tmp_path):
    model = get_published_model("13").model
    write_model(model, tmp_path / "model.json")
    for path in (tmp_path, tmp_path / "model.json"):
        assert read_saved_model(open_document(path)) == model


def test_a_diagnosis_has_no_model(tmp_path):
    (tmp_path / "discrepancy.json").write_text('{"schema": "islands.discrepancy/1"}')
    (tmp_path / "extended.json").write_text('{"schema": "islands.extended/1"}')
    for path in (tmp_path, tmp_path / "extended.json"):
        assert read_saved_model(open_document(path)) is None


@pytest.mark.parametrize("content", [{}, {"models": []}, {"models": [{"rank": 1}], "recommended": {}}])
def test_a_damaged_result_is_named(tmp_path, content):
    (tmp_path / "result.json").write_text(json.dumps({"schema": "islands.result/2"} | content))
    with pytest.raises(islands.ModelError, match=r"is damaged: .* is missing or wrong"):
        read_saved_model(open_document(tmp_path))
