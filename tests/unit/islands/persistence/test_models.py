"""Files of models of all classes."""

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import islands
from islands.errors import ModelError
from islands.persistence.models import (
    SCHEMA,
    model_from_json,
    model_json,
    read_model,
    write_model,
)
from islands.systems.published_models import PUBLISHED
from support.coupled_systems import PREY, TWO_MASSES
from support.strategies import models

finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize("model", [TWO_MASSES, PREY])
def test_a_model_is_read_as_it_was_written(model, tmp_path) -> None:
    write_model(model, tmp_path / "model.json")
    assert read_model(tmp_path / "model.json") == model


def test_a_reader_of_one_output_refuses_several() -> None:
    with pytest.raises(ModelError, match="has the outputs y1, y2: give a model of one output"):
        model_from_json(model_json(PREY), "prey")


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
        read_model(file)


def document(**changes):
    """Return the text of a model file for y(k) = 0.5 y(k-1) + 0.25 u(k-1), with changed fields."""
    fields = {
        "schema": SCHEMA,
        "inputs": ["u_V"],
        "output": "y_um",
        "dt": 0.01,
        "terms": [
            {"regressor": "y(k-1)", "parameter": 0.5, "standard_error": 0.01},
            {"regressor": "u(k-1)", "parameter": 0.25, "standard_error": 0.02},
        ],
    }
    return json.dumps({name: value for name, value in (fields | changes).items() if value is not ...})


def term(regressor, parameter=1.0, **more):
    return {"regressor": regressor, "parameter": parameter, **more}


# Round trips.


@given(models(), st.data())
def test_every_model_is_read_back_exactly(model, data):
    numbers = st.lists(finite, min_size=model.size, max_size=model.size)
    errors = st.none() | st.lists(st.floats(0, 1e300), min_size=model.size, max_size=model.size)
    model = replace(
        model.with_parameters(data.draw(numbers), data.draw(errors)),
        input_names=tuple(data.draw(st.text()) for _ in model.input_names),
        output_name=data.draw(st.text()),
        dt=data.draw(st.none() | st.floats(1e-12, 1e6)),
    )
    again = model_from_json(model_json(model))
    assert again == model
    # Equal numbers can differ in their bits: 0.0 and -0.0.
    assert repr(again.theta) == repr(model.theta)
    assert repr(again.standard_errors) == repr(model.standard_errors)
    assert model_json(again) == model_json(model)


def test_a_user_defined_primitive_is_read_if_it_is_given():
    known = islands.PRIMITIVES | {"halved": islands.primitive("halved", halved, parity=-1)}
    model = islands.make_model([(islands.parse("halved(y(k-1))", known), 0.5)])
    assert model_from_json(model_json(model), primitives=known) == model
    with pytest.raises(ModelError, match=r"terms\.0\.regressor: unknown function 'halved': take one of mul"):
        model_from_json(model_json(model))


def halved(a):
    return a / 2.0


# The file.


# Invalid files.

BROKEN = {
    "no field": ("{}", "inputs: Field required"),
    "not JSON": ("y(k) = 1", "the file: Invalid JSON"),
    "a list": ("[]", "the file: Input should be an object"),
    "another schema": (document(schema="islands.model/2"), "schema: Input should be 'islands.model/1'"),
    "unknown field": (document(author="me"), "author: Extra inputs are not permitted"),
    "unknown field of a term": (
        document(terms=[term("u(k-1)", unit="V")]),
        "terms.0.unit: Extra inputs are not permitted",
    ),
    "no inputs": (document(inputs=[]), "inputs: Tuple should have at least 1 item"),
    "inputs as a number": (document(inputs=1), "inputs: Input should be a valid array"),
    "no output": (document(output=...), "output: Field required"),
    "dt of zero": (document(dt=0.0), "dt: Input should be greater than 0"),
    "infinite dt": (document(dt=1.5).replace("1.5", "Infinity"), "dt: Input should be a finite number"),
    "no terms": (document(terms=[]), "terms: Tuple should have at least 1 item"),
    "no parameter": (document(terms=[{"regressor": "u(k-1)"}]), "terms.0.parameter: Field required"),
    "parameter as text": (
        document(terms=[term("u(k-1)"), term("y(k-1)", "much")]),
        "terms.1.parameter: Input should be a valid number",
    ),
    "parameter that is not a number": (
        document(terms=[term("u(k-1)", 1.5)]).replace("1.5", "NaN"),
        "terms.0.parameter: Input should be a finite number",
    ),
    "negative error": (
        document(terms=[term("u(k-1)", standard_error=-1.0)]),
        "terms.0.standard_error: Input should be greater than or equal to 0",
    ),
    "no expression": (
        document(terms=[term("y(k-1)"), term("u[k-1]")]),
        "terms.1.regressor: cannot read 'u[k - 1]'",
    ),
    "unknown function": (
        document(terms=[term("relu(u(k-1))")]),
        "terms.0.regressor: unknown function 'relu'",
    ),
    "present input": (
        document(terms=[term("u(k)")]),
        "terms.0.regressor: a regressor reads only past samples: channel 1 has lag 0",
    ),
    "zero": (
        document(terms=[term("u(k-1) - u(k-1)")]),
        "terms.0.regressor: 'u(k-1) - u(k-1)' is identically zero",
    ),
    "repeated regressor": (
        document(terms=[term("u(k-1)*y(k-1)"), term("2*y(k-1)*u(k-1)")]),
        "terms.1.regressor: '2*y(k-1)*u(k-1)' is given twice",
    ),
    "too many inputs": (
        document(terms=[term("u2(k-1)")]),
        "inputs: the model reads input 2 and has 1: ('u_V',)",
    ),
    "some parameters": (
        document(terms=[term("u(k-1)", None), term("y(k-1)")]),
        "parameter is given for some terms only: give it for all or for none",
    ),
    "some errors": (
        document(terms=[term("u(k-1)"), term("y(k-1)", standard_error=0.1)]),
        "standard_error is given for some terms only: give it for all or for none",
    ),
    "overflow with its factor": (
        document(terms=[term("1e10*u(k-1)", 1e300)]),
        "terms.0.parameter: 1e+300 overflows with the regressor's factor 10000000000.0",
    ),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_an_invalid_file_is_refused_with_its_name_and_field(text, message, tmp_path):
    file = tmp_path / "broken.json"
    file.write_text(text)
    with pytest.raises(ModelError) as caught:
        read_model(file)
    said = str(caught.value)
    assert said.startswith(f"{file}")
    assert message in said
    assert "pydantic" not in said


def test_a_missing_or_binary_file_is_refused(tmp_path):
    with pytest.raises(ModelError, match=r"cannot read the model file .*nowhere\.json: .*No such file"):
        read_model(tmp_path / "nowhere.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match=r"cannot read the model file .*binary\.json"):
        read_model(tmp_path / "binary.json")
    with pytest.raises(ModelError, match="cannot read the model file"):
        read_model(tmp_path)


def test_a_model_is_not_written_to_a_missing_folder(tmp_path):
    with pytest.raises(ModelError) as caught:
        write_model(PUBLISHED["12"].model, tmp_path / "nowhere" / "model.json")
    assert str(caught.value).startswith(
        f"cannot write the model file {tmp_path / 'nowhere' / 'model.json'}: No"
    )


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_model_with_infinite_numbers_is_not_written(number, tmp_path):
    model = islands.make_model([(islands.parse("y(k-1)"), 0.5), (islands.parse("u(k-1)"), number)])
    with pytest.raises(ModelError, match=r"cannot be written: terms\.1\.parameter: Input should be a finite"):
        write_model(model, tmp_path / "model.json")
    assert not (tmp_path / "model.json").exists()
