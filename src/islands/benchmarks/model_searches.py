"""Searches that a benchmark compares: what each finds on the estimation data, with its default settings.

The parameters of models of one output are estimated on all estimation data in the end, since a benchmark has
separate tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from islands.benchmarks.definition import LATENT, LINEAR, NARX
from islands.data.coupled_record import AnyRecord, CoupledRecord
from islands.data.dataset import Dataset
from islands.data.input_lead import advance_all_inputs
from islands.errors import SettingsError
from islands.estimation.latent_models import search_linear_models
from islands.facade.coupled.identification import fit_coupled
from islands.facade.fit import fit_record
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.progress import ProgressCallback, Steps, Stop
from islands.simulation.predictors import free_run


class FindModel(Protocol):
    """Search of a model on estimation data of one output or of several."""

    def __call__(self, record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> AnyModel:
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


def _find_latent(record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> AnyModel:
    if isinstance(record, CoupledRecord):
        return fit_coupled(record, model=LATENT, seed=seed, progress=progress, stop=stop).model
    return fit_record(record, model=LATENT, seed=seed, refit="all", progress=progress, stop=stop).best.model


def _find_narx(record: AnyRecord, seed: int, progress: ProgressCallback, stop: Stop, /) -> AnyModel:
    if isinstance(record, CoupledRecord):
        return fit_coupled(record, seed=seed, progress=progress, stop=stop).model
    return fit_record(record, seed=seed, refit="all", progress=progress, stop=stop).best.model


def _find_linear(record: AnyRecord, _seed: int, progress: ProgressCallback, stop: Stop, /) -> AnyModel:
    if isinstance(record, CoupledRecord):
        found = [_find_linear_model(advance_all_inputs(each), progress, stop) for each in record.records]
        return CoupledLatentModel(tuple(found))
    return _find_linear_model(record, progress, stop)


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
