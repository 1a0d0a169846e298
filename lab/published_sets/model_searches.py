"""Searches that a benchmark compares: what each finds on the estimation data, with its default settings.

The parameters of models of one output are estimated on all estimation data in the end, since a benchmark has
separate tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Any, Protocol

from islands.errors import SettingsError
from islands.estimation.latent_models import search_linear_models
from islands.facade.fit import fit_record
from islands.facade.results.fitted_model import list_metrics
from islands.facade.results.identification import Result
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.progress import ProgressCallback, Steps, Stop
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs
from islands.simulation.predictors import free_run
from islands.validation.prediction_bands import PredictionBands
from lab.published_sets.definition import LATENT, LINEAR, NARX


@dataclass(frozen=True, slots=True, eq=False)
class FoundModel:
    """Recommended model of a search, and what the search states about its predictions.

    Attributes
    ----------
    model : DynamicModel or CoupledModel
    claimed : float or None
        RMSE of the free run on the validation data, over all outputs, with the parameters before an
        estimation on all data. None if the search keeps no data for the validation.
    bands : tuple of PredictionBands
        One for each output; empty if there are none.
    """

    model: AnyModel
    claimed: float | None = None
    bands: tuple[PredictionBands, ...] = ()


class FindModel(Protocol):
    """Search of a model on estimation data of one output or of several."""

    def __call__(self, record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> FoundModel:
        """Return the recommended model.

        Raises
        ------
        IslandsError
            There is no model; the message says why.
        """
        ...


@dataclass(frozen=True, slots=True)
class ModelSearch:
    """A search of the table.

    Attributes
    ----------
    find : FindModel
    is_random : bool
        Whether the result depends on the seed. If not, one seed is enough.
    """

    find: FindModel
    is_random: bool = False


def count_terms(model: AnyModel) -> int:
    """Return the number of terms of NARX equations, or of the units of a state space."""
    match model:
        case Model():
            return model.size
        case CoupledLatentModel():
            return sum(map(count_terms, model.models))
        case CoupledModel():
            return sum(each.size for each in model.models)
        case LatentModel():
            return len(model.units)
    raise SettingsError(f"a {type(model).__name__} has no terms")


def _find_latent(record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> FoundModel:
    return _take(fit_record(record, model=LATENT, seed=seed, progress=progress, stop=stop, **_refit(record)))


def _find_narx(record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> FoundModel:
    return _take(fit_record(record, seed=seed, progress=progress, stop=stop, **_refit(record)))


def _refit(record: AnyRecord) -> dict[str, Any]:
    """Return the settings of an estimate on all data, which several outputs do not have."""
    return {"refit": "all"} if isinstance(record, Dataset) else {}


def _take(found: Result) -> FoundModel:
    """Return the recommended model."""
    best = found.best
    errors = [each["validation"]["free_run"].rmse for each in list_metrics(best.metrics).values()]
    bands = () if best.prediction_bands is None else best.prediction_bands.outputs
    return FoundModel(best.model, _claim(errors), bands)


def _claim(errors: list[float]) -> float | None:
    """Return the RMSE over all outputs; None if the free run diverges."""
    claimed = (sum(each**2 for each in errors) / len(errors)) ** 0.5
    return claimed if isfinite(claimed) else None


def _find_linear(record: AnyRecord, _seed: int, progress: ProgressCallback, stop: Stop, /) -> FoundModel:
    if isinstance(record, CoupledRecord):
        found = [_find_linear_model(advance_all_inputs(each), progress, stop) for each in record.records]
        return FoundModel(CoupledLatentModel(tuple(found)))
    return FoundModel(_find_linear_model(record, progress, stop))


def _find_linear_model(record: Dataset, progress: ProgressCallback, stop: Stop) -> LatentModel:
    found = search_linear_models(record, Steps(progress, stop))
    if not found:
        raise SettingsError("no linear model: the record is too short, or input columns depend on each other")
    # A pole outside of the unit circle does not show in the short blocks of the search.
    return min(found, key=lambda model: free_run(model, record).mean_squared_error)


#: Searches by name, in the order of the rows.
MODEL_SEARCHES: Mapping[str, ModelSearch] = MappingProxyType(
    {
        LATENT: ModelSearch(_find_latent, is_random=True),
        NARX: ModelSearch(_find_narx),
        LINEAR: ModelSearch(_find_linear),
    }
)
