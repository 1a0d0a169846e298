"""`islands.identify` with a primitive of the user."""

import decimal
import json

import numpy as np
import pytest

import islands
from islands.errors import ModelError, SettingsError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.printing import plain
from islands.persistence.checkpoints import (
    read_checkpoint,
    state_document,
    state_from_document,
    write_checkpoint,
)
from islands.report.documents.result_folder import result_json
from islands.report.text.summary import method_text
from support.own_primitive import DEAD_ZONE, LAW, SEARCH, record

TABLE = PRIMITIVES | {"dead_zone": DEAD_ZONE}


@pytest.fixture(scope="module")
def states():
    return []


@pytest.fixture(scope="module")
def result(states):
    return islands.identify(record(), on_epoch=lambda state, _: states.append(state), **SEARCH)


def test_search_finds_a_law_that_needs_the_primitive(result):
    model = result.best.model
    found = {plain(item.expression): value for item, value in zip(model.regressors, model.theta, strict=True)}
    assert found == pytest.approx(LAW, rel=1e-12)
    assert result.best.simulate(record(), warm_up=1).y[1:] == pytest.approx(record().y[1:], abs=1e-12)


def test_result_records_the_name_and_the_source(result):
    settings = json.loads(result_json(result.search_result))["settings"]
    assert settings["primitives"] == ["mul", "dead_zone"]
    assert settings["own_primitives"]["dead_zone"].startswith("def dead_zone(a):\n    return max(")
    assert "def dead_zone" not in method_text(result.search_result)


def test_result_without_own_primitives_has_no_sources():
    built_in = {**SEARCH, "primitives": ("mul", PRIMITIVES["abs"]), "generations": 0}
    settings = islands.identify(record(), **built_in).search_result.settings
    assert settings["primitives"] == ("mul", "abs")
    assert "own_primitives" not in settings


@pytest.mark.parametrize("kind", ["plain", "latex", "python", "c"])
def test_model_is_exported(result, kind):
    assert "dead" in result.best.export(kind)


def test_model_file_is_read_with_the_primitive(result, tmp_path):
    islands.write_model(result.best.model, tmp_path / "m.json")
    assert islands.read_model(tmp_path / "m.json", TABLE) == result.best.model
    with pytest.raises(ModelError, match=r"or pass your own primitive in primitives=islands\.PRIMITIVES \|"):
        islands.read_model(tmp_path / "m.json")


def test_resumed_run_equals_an_uninterrupted_one(result, states, tmp_path):
    path = tmp_path / "checkpoint.json"
    write_checkpoint(states[1].archipelago, path, state_document(states[1]))
    archipelago, header = read_checkpoint(path, TABLE)
    resumed = islands.identify(record(), start=state_from_document(archipelago, header), **SEARCH)
    assert resumed.search_result.models[0].model == result.search_result.models[0].model
    assert resumed.search_result.search.history == result.search_result.search.history


def refused(*primitives):
    with pytest.raises(SettingsError) as caught:
        islands.identify(record(), on_epoch=pytest.fail, **{**SEARCH, "primitives": primitives})
    return str(caught.value)


def test_wrong_entries_are_refused_with_advice():
    other = islands.primitive("dead_zone", lambda a: 0.5 * a)
    assert refused(DEAD_ZONE, other) == "two primitives have the name 'dead_zone': rename one of them"
    assert refused(np.tanh).endswith("is a function: pass islands.primitive(name, function)")
    assert refused("dead_zone").startswith("unknown primitive 'dead_zone': take one of mul, ")


def test_function_that_does_not_compile_is_refused_before_the_search():
    own = islands.primitive("own", lambda a: float(decimal.Decimal(a)))
    with pytest.raises(ModelError, match="primitive 'own' does not compile; use arithmetic"):
        islands.identify(record(), on_epoch=pytest.fail, **{**SEARCH, "primitives": (own,)})
