"""`read_result`: the result of a folder, from its JSON files alone."""

import json
from collections.abc import Mapping
from math import nan
from pathlib import Path
from types import MappingProxyType
from typing import Any

from islands.errors import ModelError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.identification import Result
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.persistence.ensembles import (
    bands_from_document,
    ensemble_from_document,
    output_bands_from_document,
)
from islands.persistence.saved_documents import (
    find_recommended,
    read_listed_model,
    read_shooting_interval,
)
from islands.validation.ensemble import Ensemble
from islands.validation.metrics import Metrics
from islands.validation.prediction_bands import AnyBands
from islands.validation.recommendation import Exclusion, Recommendation


def read_result(folder: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Result:
    """Read the result of a folder that `islands identify`, `islands fit` or `Result.save` wrote.

    Models, errors, settings and prediction bands are those of the search, bit for bit. A folder has no data:
    give a record to the figures.

    Parameters
    ----------
    folder : str or Path
        Folder with ``result.json`` and ``models/``.
    primitives : mapping
        Primitives that expressions may contain; add your own with ``PRIMITIVES | {mine.name: mine}``.

    Raises
    ------
    ModelError
        There is no result in the folder, it is damaged, or a model file was changed.
    """
    folder = Path(folder)
    file = folder / "result.json"
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ModelError(f"{folder} has no result.json: give the folder of a result") from error
    except (OSError, ValueError) as error:
        raise ModelError(f"{file} cannot be read ({error})") from error
    try:
        entries = document["models"]
        models = [read_listed_model(folder, entry, primitives) for entry in entries]
        ensemble = ensemble_from_document(document["ensemble"], models[0], primitives)
        stored = tuple(
            read_entry(model, entry, document, ensemble, primitives)
            for entry, model in zip(entries, models, strict=True)
        )
        separate = tuple(
            read_result(folder / each["folder"], primitives)
            for each in document.get("outputs", ())
            if (folder / each["folder"]).is_dir()
        )
        chosen = document["recommended"]
        recommendation = Recommendation(
            find_recommended(document)["rank"],
            tuple(chosen["reasons"]),
            chosen["reference"],
            tuple(Exclusion(each["reason"], tuple(each["ranks"])) for each in chosen["excluded"]),
        )
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise ModelError(f"{file} is damaged or of another version: {error!r} is missing or wrong") from error
    return Result(stored, recommendation, document["settings"], separate, folder, MappingProxyType(document))


def read_entry(
    model: AnyModel,
    entry: Mapping[str, Any],
    document: Mapping[str, Any],
    ensemble: Ensemble | None,
    primitives: Mapping[str, Primitive] = PRIMITIVES,
) -> FittedModel:
    """Return a model with its errors and prediction bands.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    entry : mapping
        Entry of the model in ``result.json``.
    document : mapping
        Content of ``result.json``.
    ensemble : Ensemble or None
        Ensemble of the result.
    primitives : mapping
        Primitives that expressions may contain.

    Raises
    ------
    KeyError, TypeError, ValueError, ModelError
        The document is damaged.
    """
    metrics: Mapping[str, Any]
    bands: AnyBands | None
    units = document["record"]["units"]
    if isinstance(model, CoupledModel):
        outputs = document["outputs"]
        metrics = {each["name"]: _read_metrics(each["metrics"]) for each in outputs}
        bands = output_bands_from_document(outputs, ensemble, model, primitives)
    else:
        metrics = _read_metrics(entry["metrics"])
        bands = bands_from_document(entry["bands"], ensemble)
    return FittedModel(
        *(model, entry["rank"], metrics, entry["warm_up"], read_shooting_interval(document), bands),
        tuple(units["outputs"]) if isinstance(model, CoupledModel) else (units["output"],),
        MappingProxyType(entry),
    )


def _read_metrics(document: Mapping[str, Any]) -> dict[str, dict[str, Metrics]]:
    return {
        part: {
            mode: Metrics(**{name: nan if number is None else number for name, number in errors.items()})
            for mode, errors in by_mode.items()
        }
        for part, by_mode in document.items()
    }
