"""The model of a document is the one that `islands.load` opens."""

import json

import pytest

import islands
from islands.persistence.saved_documents import open_document, read_saved_model
from support.identifications import record


@pytest.fixture
def result(tmp_path):
    search = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0, "average": 1}
    return islands.fit(record(300), **search).save(tmp_path / "result", figures=())


@pytest.mark.ci
def test_the_model_of_a_result_is_the_recommended_one(result):
    assert read_saved_model(open_document(result)) == islands.load(result).best.model
    document = json.loads((result / "result.json").read_text())
    last = len(document["models"])
    assert last > 1
    for rank in (1, last):
        document["recommended"]["rank"] = rank
        (result / "result.json").write_text(json.dumps(document))
        expected = islands.load(result / "models" / f"{rank:02d}.json").model
        assert read_saved_model(open_document(result)) == expected


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
