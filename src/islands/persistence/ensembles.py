"""Ensemble and prediction bands of a result as JSON values, also in the file of a model."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.printing import plain
from islands.expressions.tree import Primitive
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.narx import Model
from islands.models.regressor import Regressor, regressor
from islands.persistence.models import model_from_json, model_json, read_coupled
from islands.validation.data_range import DataRange
from islands.validation.ensemble import Ensemble, EnsembleStructure
from islands.validation.prediction_bands import AnyBands, OutputBands, PredictionBands


class StructureDocument(BaseModel):
    """A structure of an ensemble: its weight, its terms or its model, and the parameters of its members.

    ``law`` is the position of the structure with the same free run that this one counts as, if there is one.
    """

    model_config = ConfigDict(frozen=True)

    weight: Annotated[FiniteFloat, Field(gt=0, le=1)]
    regressors: tuple[str, ...] = ()
    model: dict[str, Any] | None = None
    parameters: Annotated[tuple[tuple[FiniteFloat, ...], ...], Field(min_length=1)]
    law: Annotated[int, Field(ge=0)] | None = None


class RangeDocument(BaseModel):
    """Range of the data outside of which bands widen, and how: see `DataRange`."""

    model_config = ConfigDict(frozen=True)

    output: tuple[FiniteFloat, FiniteFloat]
    inputs: tuple[tuple[FiniteFloat, FiniteFloat], ...]
    predictable: Annotated[FiniteFloat, Field(ge=0, le=1)]
    memory: Annotated[FiniteFloat, Field(gt=0)]


class BandsDocument(BaseModel):
    """Width of the bands of a model: the noise, the median width, the factors by level, and the range."""

    model_config = ConfigDict(frozen=True)

    noise: Annotated[FiniteFloat, Field(ge=0)]
    width: Annotated[FiniteFloat, Field(ge=0)]
    levels: Annotated[tuple[FiniteFloat, ...], Field(min_length=1)]
    factors: Annotated[tuple[FiniteFloat, ...], Field(min_length=1)]
    coverage: Annotated[FiniteFloat, Field(ge=0, le=1)] | None = None
    range: RangeDocument | None = None
    independent_samples: Annotated[FiniteFloat, Field(gt=0)] | None = None


def ensemble_document(ensemble: Ensemble | None) -> list[dict[str, Any]] | None:
    """Return the structures of an ensemble as JSON values, None for no ensemble."""
    if ensemble is None:
        return None
    return [
        {
            "weight": each.weight,
            **_structure_document(each.model),
            "parameters": each.parameters.tolist(),
            "law": each.law,
        }
        for each in ensemble.structures
    ]


def _structure_document(model: AnyModel) -> dict[str, Any]:
    if isinstance(model, Model):
        return {"regressors": [plain(item.expression, model.inputs) for item in model.regressors]}
    return {"model": json.loads(model_json(model))}


def ensemble_from_document(
    document: Any, model: AnyModel, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> Ensemble | None:
    """Return the ensemble of a document.

    Parameters
    ----------
    document : list or None
        Value made by `ensemble_document`.
    model : DynamicModel or CoupledModel
        A model of the result. It gives the names of the columns and the sampling time.
    primitives : mapping
        Primitives that expressions may contain.

    Raises
    ------
    ModelError
        The document is damaged.
    """
    if document is None:
        return None
    try:
        structures = [StructureDocument.model_validate(each) for each in document]
        if any(structure.law is not None and structure.law >= len(structures) for structure in structures):
            raise ValueError("a structure has the law of one that is missing")
        return Ensemble(tuple(_structure(structure, model, primitives) for structure in structures))
    except (ModelError, TypeError, ValueError) as error:
        raise ModelError(f"the ensemble of the result is damaged: {error}") from error


def _structure(
    document: StructureDocument, model: AnyModel, primitives: Mapping[str, Primitive]
) -> EnsembleStructure:
    parameters = np.array(document.parameters, dtype=np.float64)
    structure: AnyModel
    if isinstance(model, CoupledModel):
        structure = read_coupled(document.model or {}, "the ensemble", primitives)
    elif document.model is not None:
        structure = model_from_json(json.dumps(document.model), "the ensemble")
    else:
        structure = Model(
            tuple(_regressor(text, primitives) for text in document.regressors),
            input_names=model.input_names,
            output_name=model.output_name,
            dt=model.dt,
            average=model.average,
            preprocessing=model.preprocessing,
        )
    if parameters.shape[1] != structure.size:
        raise ValueError(f"{parameters.shape[1]} parameters for {structure.size} terms")
    return EnsembleStructure(structure, document.weight, parameters, document.law)


def output_bands_from_document(
    outputs: Sequence[Mapping[str, Any]],
    shared: Ensemble | None,
    model: CoupledModel,
    primitives: Mapping[str, Primitive] = PRIMITIVES,
) -> OutputBands | None:
    """Return the bands of every output; None if one has none.

    Parameters
    ----------
    outputs : sequence of mapping
        ``outputs`` of ``result.json``, with the ensemble of each unless all of them have one.
    shared : Ensemble or None
        Ensemble of all outputs.
    model : CoupledModel

    Raises
    ------
    ModelError
        The document is damaged.
    """
    found = [
        bands_from_document(
            each["bands"], shared or ensemble_from_document(each.get("ensemble"), single, primitives)
        )
        for each, single in zip(outputs, model.models, strict=True)
    ]
    bands = tuple(each for each in found if each is not None)
    return OutputBands(bands) if len(bands) == len(found) else None


def _regressor(text: str, primitives: Mapping[str, Primitive]) -> Regressor:
    factor, item = regressor(parse(text, primitives))
    if item is None or factor != 1.0:
        raise ModelError(f"{text!r} is not a canonical term")
    return item


def bands_document(bands: PredictionBands | None) -> dict[str, Any] | None:
    """Return the width of the bands of a model as JSON values, None for no bands."""
    if bands is None:
        return None
    return {
        "noise": bands.noise,
        "width": bands.width,
        "levels": list(bands.factors),
        "factors": list(bands.factors.values()),
        "coverage": bands.coverage,
        "range": None if bands.data_range is None else asdict(bands.data_range),
        "independent_samples": bands.independent_samples,
    }


def bands_from_document(document: Any, ensemble: Ensemble | None) -> PredictionBands | None:
    """Return the bands of a document and an ensemble; None if one of them is None.

    Raises
    ------
    ModelError
        The document is damaged.
    """
    if document is None or ensemble is None:
        return None
    try:
        found = BandsDocument.model_validate(document)
        factors = dict(zip(found.levels, found.factors, strict=True))
        data_range = None if found.range is None else DataRange(**found.range.model_dump())
        return PredictionBands(
            *(ensemble, found.noise, found.width, factors, found.coverage, data_range),
            found.independent_samples,
        )
    except ValueError as error:
        raise ModelError(f"the bands of the result are damaged: {error}") from error


def model_file(model: AnyModel, bands: AnyBands | None) -> str:
    """Return the text of the file of a model with its uncertainty: the ensemble and the prediction bands.

    The file then has the same bands without the folder of its result.

    Raises
    ------
    ModelError
        A number of the model is not finite.
    """
    text = model_json(model)
    if bands is None:
        return text
    shared = bands.ensemble
    uncertainty = {
        "ensemble": ensemble_document(shared),
        "outputs": [
            {
                "bands": bands_document(each),
                **({} if shared else {"ensemble": ensemble_document(each.ensemble)}),
            }
            for each in bands.outputs
        ],
    }
    # In one line, since the numbers are for programs.
    content = text.rstrip().removesuffix("}").rstrip()
    return f'{content},\n  "uncertainty": {json.dumps(uncertainty)}\n}}\n'


def bands_of_file(
    document: Mapping[str, Any], model: AnyModel, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> AnyBands | None:
    """Return the bands in the document of a model file; None if it has none.

    Raises
    ------
    ModelError
        The document is damaged.
    """
    found = document.get("uncertainty")
    if not found:
        return None
    try:
        shared, outputs = ensemble_from_document(found["ensemble"], model, primitives), found["outputs"]
        if isinstance(model, CoupledModel):
            return output_bands_from_document(outputs, shared, model, primitives)
        return bands_from_document(outputs[0]["bands"], shared)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ModelError(
            f"the uncertainty of the model file is damaged: {error!r} is missing or wrong"
        ) from error
