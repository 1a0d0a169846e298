"""Files of models: JSON with a tag of the class, and the table of classes. Equal models give equal files."""

import json
from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from islands.document_problems import find_problem
from islands.errors import ModelError, lookup
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model, canonical_order, require_narx
from islands.models.parametric import ParametricModel
from islands.models.protocol import DynamicModel, no_model_error
from islands.models.regressor import Regressor, regressor
from islands.records.preprocessing_steps import Preprocessing

SCHEMA: Literal["islands.model/1"] = "islands.model/1"

#: Tag of NARX models.
NARX = Model.kind

_CLASSES: dict[str, type[ParametricModel]] = {LatentModel.kind: LatentModel}

#: Classes of models by tag that `fit` estimates by the error of the free run; NARX models are selected from a
#: library or evolved.
MODEL_CLASSES: Mapping[str, type[ParametricModel]] = MappingProxyType(_CLASSES)


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
    #: See `islands.persistence.ensembles`.
    uncertainty: Annotated[dict[str, Any] | None, Field(exclude=True)] = None


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


def model_json(model: AnyModel) -> str:
    """Return a model as JSON text.

    Raises
    ------
    ModelError
        A number of the model is not finite; JSON cannot represent it.
    """
    match model:
        case Model():
            return narx_json(model)
        case CoupledModel():
            models = [json.loads(model_json(single)) for single in model.models]
            content = {**model.document(), "models": models}
        case _:
            content = model.document()
    document = {"schema": SCHEMA, "kind": model.kind, **content}
    try:
        return json.dumps(document, indent=2, allow_nan=False) + "\n"
    except ValueError as error:
        raise ModelError(f"the model cannot be written: {error}") from error


def terms_document(model: AnyModel) -> list[dict[str, Any]]:
    """Return the parameters of a model in the form of ``result.json``; a regressor is a term or a name."""
    if isinstance(model, Model):
        return list(model.document()["terms"])
    errors = model.standard_errors or (None,) * model.size
    return [
        {"regressor": name, "parameter": parameter, "standard_error": error}
        for name, parameter, error in zip(model.parameter_names, model.parameters, errors, strict=True)
    ]


def write_model(model: AnyModel, path: str | Path) -> None:
    """Write a model file.

    Raises
    ------
    ModelError
        It is no model, a number of it is not finite, or the file cannot be written.
    """
    if not isinstance(model, Model | CoupledModel | ParametricModel):
        raise no_model_error(model, ", or save the result by result.save(folder)")
    text = model_json(model)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise ModelError(f"cannot write the model file {path}: {error.strerror}") from error


def read_model(path: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> AnyModel:
    """Read the file of a model of one or several outputs.

    Parameters
    ----------
    primitives : mapping
        Primitives that expressions may contain; add your own with ``PRIMITIVES | {mine.name: mine}``.

    Raises
    ------
    ModelError
        The file does not exist or is not a model file. The message names the invalid field.
    """
    return any_model_from_json(_read_text(path), str(path), primitives)


def any_model_from_json(
    text: str, name: str = "model", primitives: Mapping[str, Primitive] = PRIMITIVES
) -> AnyModel:
    """Parse the text of a model file. ``name`` is the name of the file in error messages.

    Raises
    ------
    ModelError
        As in `read_model`.
    """
    try:
        document = json.loads(text)
    except ValueError:
        document = None  # reported as a damaged document of a NARX model
    if not isinstance(document, dict) or "kind" not in document:
        return read_narx(text, name, primitives)
    readers: dict[str, Callable[[], AnyModel]] = {
        kind: partial(made.read, document, name) for kind, made in MODEL_CLASSES.items()
    }
    for kind in (CoupledModel.kind, CoupledLatentModel.kind):
        readers[kind] = partial(read_coupled, document, name, primitives)
    return lookup(readers, str(document["kind"]), f"class of models of {name}")()


def model_from_json(
    text: str, name: str = "model", primitives: Mapping[str, Primitive] = PRIMITIVES
) -> DynamicModel:
    """Parse the text of a file of a model of one output; see `any_model_from_json`.

    Raises
    ------
    ModelError
        As in `read_model`; or the model has several outputs.
    """
    model = any_model_from_json(text, name, primitives)
    if isinstance(model, CoupledModel):
        raise ModelError(
            f"{name} has the outputs {', '.join(model.output_names)}: give a model of one output"
        )
    return model


def read_validated_model(entry: Mapping[str, Any], model: DynamicModel) -> DynamicModel:
    """Return the model that the errors of an entry of ``result.json`` belong to.

    Parameters
    ----------
    entry : mapping
    model : DynamicModel
        Model of the entry. Its parameters are others if they were estimated again on all data.

    Raises
    ------
    ModelError
        The document is damaged.
    """
    found = (entry.get("refit") or {}).get("validated_model")
    return model if found is None else model_from_json(json.dumps(found), "the validated model of the result")


def read_coupled(
    document: Mapping[str, Any], name: str, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> CoupledModel:
    """Read the JSON values of a model of several outputs; see `any_model_from_json`."""
    entries = document.get("models")
    if not isinstance(entries, list):
        raise ModelError(f"{name}: models: there is no list of models")
    models = tuple(
        model_from_json(json.dumps(entry), f"{name}: models.{place}", primitives)
        for place, entry in enumerate(entries)
    )
    latent = tuple(model for model in models if isinstance(model, LatentModel))
    return CoupledLatentModel(latent) if latent and len(latent) == len(models) else CoupledModel(models)


def narx_from_json(text: str, name: str, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Model:
    """Parse the text of a NARX model of one output; other models raise `ModelError`."""
    return require_narx(model_from_json(text, name, primitives))


def _read_text(path: str | Path) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"cannot read the model file {path}: {error}") from error
