"""Documents of NARX models: JSON with a schema version and exact floats."""

from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from islands.document_problems import find_problem
from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.models.narx import Model, canonical_order
from islands.models.regressor import Regressor, regressor
from islands.records.preprocessing_steps import Preprocessing

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


def narx_json(model: Model) -> str:
    """Return a model as JSON text.

    Raises
    ------
    ModelError
        A number of the model is not finite; JSON cannot represent it.
    """
    try:
        document = ModelDocument.model_validate(model.document())
    except ValidationError as error:
        raise ModelError(f"the model cannot be written: {_explain(error)}") from error
    # Models of measured signals need no steps.
    left_out = {"preprocessing"} if model.preprocessing is None else None
    return document.model_dump_json(by_alias=True, indent=2, exclude=left_out) + "\n"


def read_narx(text: str, name: str, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Model:
    """Read the JSON text of a model.

    Parameters
    ----------
    text : str
    name : str
        Name of the file in error messages.
    primitives : mapping
        Primitives that expressions may contain.

    Raises
    ------
    ModelError
        It is not a document of a model. The message names the invalid field.
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
