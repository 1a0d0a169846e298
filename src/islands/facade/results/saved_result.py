"""`read_result`: the result of a folder, from its JSON files alone."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from islands.data.dataset import Dataset
from islands.errors import ModelError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.facade.results.assessed_model import AssessedModel
from islands.facade.results.model_simulation import SHOOTING
from islands.facade.results.notebook_html import render_html
from islands.facade.results.ranked_models import RankedModels, write_validation_key
from islands.io.ensembles import bands_from_document, ensemble_from_document
from islands.io.models import read_model, terms_document
from islands.io.result_models import check_single_output, read_shooting_interval
from islands.model.model import Model
from islands.validation.metrics import Metrics
from islands.validation.prediction_bands import PredictionBands
from islands.validation.recommendation import Recommendation

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SavedModel(AssessedModel):
    """One model of a result folder, or of a model file.

    Attributes
    ----------
    rank : int or None
        Rank of the model; 1 has the least validation error. None for a file outside of a result folder.
    model : Model
        Regressors, parameters, standard errors.
    document : mapping
        Entry of the model in ``result.json``: also physics checks, residual tests and constraints. Empty
        outside of a result folder.
    metrics : mapping
        Errors by part and prediction, for example ``metrics["validation"]["free_run"].mape``; empty outside
        of a result folder.
    warm_up, shooting_interval : int
        Samples before the first prediction, and steps in an interval of multiple shooting, of these errors.
    prediction_bands : PredictionBands or None
        Prediction bands of every level; None if the free run of the model diverged, or outside of a result
        folder.
    output_unit : str
        Unit of the output; empty if unknown.
    """

    rank: int | None
    model: Model
    document: Mapping[str, Any]
    metrics: Mapping[str, Mapping[str, Metrics]]
    warm_up: int
    shooting_interval: int
    prediction_bands: PredictionBands | None
    output_unit: str

    @property
    def validation(self) -> Dataset:
        """A folder has no data.

        Raises
        ------
        ModelError
            Always.
        """
        raise ModelError("a result folder has no data: give a record, plot(record=...)")

    def _draw(self, kind: str) -> "Figure":
        raise ModelError(f"a result folder has no data: give a record, plot({kind!r}, record=...)")

    def _repr_html_(self) -> str:
        return render_html(self.model, [self.describe_error()] if self.metrics else [])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SavedResult(RankedModels[SavedModel]):
    """Result of a folder.

    Attributes
    ----------
    folder : Path
    document : mapping
        Content of ``result.json``: record, settings, statistics of the search, models.
    models : tuple of SavedModel
        All models, in the order of their free-run error on the validation data.
    recommendation : Recommendation
        Rank of the recommended model, and the reasons for the choice.
    """

    folder: Path
    document: Mapping[str, Any]
    models: tuple[SavedModel, ...]
    recommendation: Recommendation

    @property
    def settings(self) -> Mapping[str, Any]:
        """Settings that determine the result, together with the record and the seed."""
        settings: Mapping[str, Any] = self.document["settings"]
        return settings

    @property
    def validation_key(self) -> str:
        """Text that identifies the validation data."""
        average = self.document["preprocessing"]["average"]
        return write_validation_key(self.document["record"]["sha256"], self.settings, average)

    def __str__(self) -> str:
        return (self.folder / "summary.txt").read_text(encoding="utf-8")

    def _repr_html_(self) -> str:
        reasons = [f"Recommended: model {self.best.rank}: {'; '.join(self.recommendation.reasons)}"]
        return render_html(self.best.model, [*reasons, self.best.describe_error()])


def read_result(folder: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> SavedResult:
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
    if isinstance(document, dict):
        check_single_output(document, folder)
    try:
        entries = document["models"]
        models = [_read_model(folder, entry, primitives) for entry in entries]
        # Results of earlier versions have no ensemble and no warm-up, and recommend no model.
        ensemble = ensemble_from_document(document.get("ensemble"), models[0], primitives)
        shooting = read_shooting_interval(document)
        stored = tuple(
            SavedModel(
                entry["rank"],
                model,
                MappingProxyType(entry),
                _read_metrics(entry["metrics"]),
                model.maximum_lag if entry.get("warm_up") is None else entry["warm_up"],
                shooting,
                bands_from_document(entry.get("bands"), ensemble),
                document["record"]["units"]["output"],
            )
            for entry, model in zip(entries, models, strict=True)
        )
        chosen = document.get("recommended", {"rank": 1, "reasons": ()})
        recommendation = Recommendation(entries[chosen["rank"] - 1]["rank"], tuple(chosen["reasons"]))
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise ModelError(f"{file} is damaged or of another version: {error!r} is missing or wrong") from error
    return SavedResult(folder, MappingProxyType(document), stored, recommendation)


def make_single_model(model: Model) -> SavedModel:
    """Return a model outside of a result folder: simulations start after its largest lag."""
    nothing: Mapping[str, Any] = MappingProxyType({})
    return SavedModel(None, model, nothing, nothing, model.maximum_lag, SHOOTING, None, "")


def _read_model(folder: Path, entry: Mapping[str, Any], primitives: Mapping[str, Primitive]) -> Model:
    """Read the file of an entry of ``result.json``, which must be the model of the entry."""
    path = folder / "models" / f"{entry['rank']:02d}.json"
    model = read_model(path, primitives)
    written, expected = (
        [(term["regressor"], term["parameter"]) for term in terms]
        for terms in (terms_document(model), entry["terms"])
    )
    if written != expected:
        raise ModelError(
            f"{path} is not the model of {folder / 'result.json'}, whose errors and bands belong to another: "
            "give a changed model as a file outside of the folder"
        )
    return model


def _read_metrics(document: Mapping[str, Any]) -> dict[str, dict[str, Metrics]]:
    return {
        part: {
            mode: Metrics(**{name: nan if number is None else number for name, number in errors.items()})
            for mode, errors in by_mode.items()
        }
        for part, by_mode in document.items()
    }
