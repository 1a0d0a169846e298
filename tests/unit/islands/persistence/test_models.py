"""Files of models of all classes."""

import json

import pytest

from islands.errors import ModelError
from islands.persistence.models import model_json, read_coupled_model, write_model
from support.coupled_systems import PREY, TWO_MASSES


@pytest.mark.parametrize("model", [TWO_MASSES, PREY])
def test_a_model_is_read_as_it_was_written(model, tmp_path) -> None:
    write_model(model, tmp_path / "model.json")
    assert read_coupled_model(tmp_path / "model.json") == model
    assert read_coupled_model(tmp_path) == model


def test_other_files_are_not_coupled_models(tmp_path) -> None:
    write_model(PREY.models[0], tmp_path / "single.json")
    with pytest.raises(ModelError, match="not a coupled model of schema"):
        read_coupled_model(tmp_path / "single.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"models": None}, "models: there is no list"),
        ({"models": [{"schema": "islands.model/1"}] * 2}, "models.0 is not a model file"),
        ({"models": []}, "at least two equations"),
    ],
)
def test_a_damaged_file_names_the_field(change, message, tmp_path) -> None:
    file = tmp_path / "model.json"
    file.write_text(json.dumps(json.loads(model_json(PREY)) | change))
    with pytest.raises(ModelError, match=message):
        read_coupled_model(file)
