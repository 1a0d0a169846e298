"""Model files: JSON with a schema version, every float kept exactly."""

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from islands.errors import ModelError
from islands.model.equations import equation, latex_equation
from islands.model.expression import Primitive
from islands.model.model import Model, canonical_order
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES
from islands.model.regressor import Regressor, regressor
from islands.model.rendering import plain

SCHEMA: Literal["islands.model/1"] = "islands.model/1"


class TermDocument(BaseModel):
    """One term of a model, as it stands in a file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    regressor: str
    parameter: FiniteFloat | None
    standard_error: Annotated[FiniteFloat, Field(ge=0)] | None = None


class ModelDocument(BaseModel):
    """A model, as it stands in a file; ``equation`` and ``latex`` are for the reader and never read back."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    schema_version: Annotated[Literal["islands.model/1"], Field(alias="schema")] = SCHEMA
    inputs: Annotated[tuple[str, ...], Field(min_length=1)]
    output: str
    dt: Annotated[FiniteFloat, Field(gt=0)] | None = None
    equation: str = ""
    latex: str = ""
    terms: Annotated[tuple[TermDocument, ...], Field(min_length=1)]


def terms_document(model: Model) -> list[dict[str, Any]]:
    """Return a model's terms as they stand in model files and in ``result.json``."""
    parameters = model.theta or (None,) * model.size
    errors = model.standard_errors or (None,) * model.size
    return [
        {"regressor": plain(item.expression, model.inputs), "parameter": parameter, "standard_error": error}
        for item, parameter, error in zip(model.regressors, parameters, errors, strict=True)
    ]


def model_json(model: Model) -> str:
    """Write a model as JSON; the same model gives the same text.

    Raises
    ------
    ModelError
        A number of the model is not finite: JSON has no word for it.
    """
    fields = {
        "inputs": model.input_names,
        "output": model.output_name,
        "dt": model.dt,
        "equation": equation(model),
        "latex": latex_equation(model),
        "terms": terms_document(model),
    }
    try:
        document = ModelDocument.model_validate(fields)
    except ValidationError as error:
        raise ModelError(f"the model cannot be written: {_problem(error)}") from error
    return document.model_dump_json(by_alias=True, indent=2) + "\n"


def write_model(model: Model, path: str | Path) -> None:
    """Write a model file.

    Raises
    ------
    ModelError
        A number of the model is not finite, or the file cannot be written.
    """
    text = model_json(model)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise ModelError(f"cannot write the model file {path}: {error.strerror}") from error


def read_model(path: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Model:
    """Read a model file.

    Parameters
    ----------
    primitives : mapping
        Functions that may stand in it; give your own with ``PRIMITIVES | {mine.name: mine}``.

    Raises
    ------
    ModelError
        There is no such file, or it is no model file: the message names the field.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"cannot read the model file {path}: {error}") from error
    return model_from_json(text, str(path), primitives)


def model_from_json(
    text: str, name: str = "model", primitives: Mapping[str, Primitive] = PRIMITIVES
) -> Model:
    """Make a model of the text of a model file.

    Raises
    ------
    ModelError
        As in `read_model`.
    """
    try:
        document = ModelDocument.model_validate_json(text)
    except ValidationError as error:
        raise ModelError(f"{name} is no model file of schema {SCHEMA}: {_problem(error)}") from error
    terms: dict[Regressor, tuple[float | None, float | None]] = {}
    for position, term in enumerate(document.terms):
        where = f"{name}: terms.{position}"
        factor, item = _canonical(term.regressor, primitives, f"{where}.regressor")
        if item in terms:
            raise ModelError(f"{where}.regressor: {term.regressor!r} stands there twice")
        # A term may be written in any way: what canonical form takes out belongs to the parameter.
        terms[item] = (
            _times(factor, term.parameter, f"{where}.parameter"),
            _times(abs(factor), term.standard_error, f"{where}.standard_error"),
        )
    ordered = canonical_order(terms)
    theta = _complete([terms[item][0] for item in ordered], f"{name}: parameter")
    errors = _complete([terms[item][1] for item in ordered], f"{name}: standard_error")
    try:
        return Model(tuple(ordered), theta, document.inputs, document.output, document.dt, errors)
    except ModelError as error:
        raise ModelError(f"{name}: inputs: {error}") from error


def _problem(error: ValidationError) -> str:
    """Name the first field that is wrong, and say what it should be."""
    problem = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in problem["loc"]) or "the file"
    return f"{where}: {problem['msg']}"


def _canonical(text: str, primitives: Mapping[str, Primitive], where: str) -> tuple[float, Regressor]:
    try:
        factor, item = regressor(parse(text, primitives))
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error
    if item is None:
        raise ModelError(f"{where}: {text!r} is identically zero")
    return factor, item


def _times(factor: float, number: float | None, where: str) -> float | None:
    if number is None:
        return None
    if not isfinite(factor * number):
        raise ModelError(f"{where}: {number!r} overflows with the regressor's factor {factor!r}")
    return factor * number


def _complete(values: list[float | None], what: str) -> tuple[float, ...] | None:
    """Return numbers that are all there, or None where none is."""
    there = tuple(value for value in values if value is not None)
    if there and len(there) < len(values):
        raise ModelError(f"{what} is given for some terms only: give it for all or for none")
    return there or None
