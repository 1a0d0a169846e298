"""Results read from a folder."""

import json
import shutil

import pytest

import islands
from islands.facade.results.reader import read_result
from support.searches import record


@pytest.fixture(scope="module")
def stored(folder):
    return read_result(folder)


@pytest.mark.ci
def test_a_folder_gives_the_models_errors_and_settings_of_the_result(result, stored):
    assert [each.model for each in stored.models] == [each.model for each in result.models]
    assert [each.metrics for each in stored.models] == [each.metrics for each in result.models]
    assert stored.recommendation == result.recommendation
    assert stored.best.rank == result.best.rank
    assert stored.settings["library"] == "polynomial"
    assert stored.to_pandas().equals(result.to_pandas())
    assert str(stored) == str(result)
    assert repr(stored) == f"<Result of {len(result.models)} models, recommended: {result.best.equation}>"


def test_figures_of_a_folder_need_a_record(stored):
    with pytest.raises(islands.ModelError, match="give a record"):
        stored.best.plot()
    assert stored.best.plot(record=record(300)).axes
    assert "</math>" in stored._repr_html_()
    assert "RMSE" in stored.models[0]._repr_html_()


def test_a_result_and_its_folder_have_the_same_errors_on_the_same_data(result, stored):
    compared = result.compare(stored, names=("new", "stored"))
    assert compared.data == "the validation data"
    new, old = compared.recommended
    assert (new.rmse, new.equation) == (old.rmse, old.equation)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda document: document.clear(), "of another version"),
        (lambda document: document["models"].pop(), "out of range"),
        (lambda document: document["models"][0].pop("metrics"), "'metrics'"),
        (lambda document: document["models"][0]["terms"].pop(), "is not the model of"),
    ],
)
def test_damaged_results_are_named(folder, tmp_path, damage, message):
    shutil.copytree(folder, tmp_path / "copy")
    file = tmp_path / "copy" / "result.json"
    document = json.loads(file.read_text())
    document["recommended"]["rank"] = len(document["models"])
    damage(document)
    file.write_text(json.dumps(document))
    with pytest.raises(islands.ModelError, match=message):
        read_result(tmp_path / "copy")


def test_a_folder_without_a_result_is_named(tmp_path):
    with pytest.raises(islands.ModelError, match=r"has no result\.json"):
        read_result(tmp_path)
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(islands.ModelError, match="cannot be read"):
        read_result(tmp_path)
