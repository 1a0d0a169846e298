"""Model files: JSON with a schema version and exact floats."""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from islands.data.preprocessing_steps import Preprocessing
from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.printing import plain
from islands.expressions.tree import Primitive
from islands.io.document_problems import find_problem
from islands.io.result_models import read_preprocessing
from islands.models.equations import equation, latex_equation
from islands.models.narx import Model, canonical_order
from islands.models.regressor import Regressor, regressor

SCHEMA: Literal["islands.model/1"] = "islands.model/1"


class TermDocument(BaseModel):
    """One term of a model in a file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    regressor: str
    parameter: FiniteFloat | None
    standard_error: Annotated[FiniteFloat, Field(ge=0)] | None = None


class ModelDocument(BaseModel):
    """A model in a file. ``equation`` and ``latex`` are for human readers and are never read back."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    schema_version: Annotated[Literal["islands.model/1"], Field(alias="schema")] = SCHEMA
    inputs: Annotated[tuple[str, ...], Field(min_length=1)]
    output: str
    dt: Annotated[FiniteFloat, Field(gt=0)] | None = None
    average: Annotated[int, Field(ge=1)] = 1
    preprocessing: Preprocessing | None = None
    equation: str = ""
    latex: str = ""
    terms: Annotated[tuple[TermDocument, ...], Field(min_length=1)]


def terms_document(model: Model) -> list[dict[str, Any]]:
    """Return the terms of a model in the form used by model files and ``result.json``."""
    parameters = model.theta or (None,) * model.size
    errors = model.standard_errors or (None,) * model.size
    return [
        {"regressor": plain(item.expression, model.inputs), "parameter": parameter, "standard_error": error}
        for item, parameter, error in zip(model.regressors, parameters, errors, strict=True)
    ]


def model_json(model: Model) -> str:
    """Return a model as JSON text. Equal models give equal texts.

    Raises
    ------
    ModelError
        A number of the model is not finite; JSON cannot represent it.
    """
    fields = {
        "inputs": model.input_names,
        "output": model.output_name,
        "dt": model.dt,
        "average": model.average,
        "preprocessing": model.preprocessing,
        "equation": equation(model),
        "latex": latex_equation(model),
        "terms": terms_document(model),
    }
    try:
        document = ModelDocument.model_validate(fields)
    except ValidationError as error:
        raise ModelError(f"the model cannot be written: {_explain(error)}") from error
    # Models of measured signals have the files of earlier versions.
    left_out = {"preprocessing"} if model.preprocessing is None else None
    return document.model_dump_json(by_alias=True, indent=2, exclude=left_out) + "\n"


def write_model(model: Model, path: str | Path) -> None:
    """Write a model file.

    Raises
    ------
    ModelError
        A number of the model is not finite, or the file cannot be written.
    """
    write_model_text(model_json(model), path)


def write_model_text(text: str, path: str | Path) -> None:
    """Write the text of a model file.

    Raises
    ------
    ModelError
        The file cannot be written.
    """
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise ModelError(f"cannot write the model file {path}: {error.strerror}") from error


def read_model(path: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Model:
    """Read a model file.

    Parameters
    ----------
    primitives : mapping
        Primitives that expressions may contain; add your own with ``PRIMITIVES | {mine.name: mine}``.

    Raises
    ------
    ModelError
        The file does not exist or is not a model file. The message names the invalid field.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"cannot read the model file {path}: {error}") from error
    model = model_from_json(text, str(path), primitives)
    # Earlier versions wrote the preprocessing to result.json alone.
    return model if model.preprocessing else replace(model, preprocessing=read_preprocessing(path))


def model_from_json(
    text: str, name: str = "model", primitives: Mapping[str, Primitive] = PRIMITIVES
) -> Model:
    """Parse the text of a model file. ``name`` is the name of the file in error messages.

    Raises
    ------
    ModelError
        As in `read_model`.
    """
    try:
        document = ModelDocument.model_validate_json(text)
    except ValidationError as error:
        raise ModelError(f"{name} is not a model file of schema {SCHEMA}: {_explain(error)}") from error
    terms: dict[Regressor, tuple[float | None, float | None]] = {}
    for position, term in enumerate(document.terms):
        where = f"{name}: terms.{position}"
        factor, item = _parse_regressor(term.regressor, primitives, f"{where}.regressor")
        if item in terms:
            raise ModelError(f"{where}.regressor: {term.regressor!r} is given twice")
        # A file may contain terms that are not in canonical form: the constant factor that canonicalisation
        # extracts is multiplied into the parameter.
        terms[item] = (
            _scale(factor, term.parameter, f"{where}.parameter"),
            _scale(abs(factor), term.standard_error, f"{where}.standard_error"),
        )
    ordered = canonical_order(terms)
    theta = _all_or_none([terms[item][0] for item in ordered], f"{name}: parameter")
    errors = _all_or_none([terms[item][1] for item in ordered], f"{name}: standard_error")
    try:
        return Model(
            *(tuple(ordered), theta, document.inputs, document.output, document.dt, errors),
            document.average,
            document.preprocessing,
        )
    except ModelError as error:
        raise ModelError(f"{name}: inputs: {error}") from error


def _explain(error: ValidationError) -> str:
    where, message = find_problem(error, ModelDocument)
    return f"{where or 'the file'}: {message}"


def _parse_regressor(text: str, primitives: Mapping[str, Primitive], where: str) -> tuple[float, Regressor]:
    try:
        factor, item = regressor(parse(text, primitives))
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error
    if item is None:
        raise ModelError(f"{where}: {text!r} is identically zero")
    return factor, item


def _scale(factor: float, number: float | None, where: str) -> float | None:
    if number is None:
        return None
    if not isfinite(factor * number):
        raise ModelError(f"{where}: {number!r} overflows with the regressor's factor {factor!r}")
    return factor * number


def _all_or_none(values: list[float | None], field: str) -> tuple[float, ...] | None:
    """Return the numbers if all are given, None if none is given."""
    given = tuple(value for value in values if value is not None)
    if given and len(given) < len(values):
        raise ModelError(f"{field} is given for some terms only: give it for all or for none")
    return given or None
