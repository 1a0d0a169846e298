"""Join of separate searches of latent models to a result of several outputs."""

from collections.abc import Sequence
from dataclasses import replace

from islands.errors import ModelError
from islands.facade.coupled.result import CoupledResult
from islands.facade.results.identification import Result
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.progress import Steps
from islands.records.coupled import CoupledSplit
from islands.records.input_lead import advance_all_inputs
from islands.validation.ensemble import Ensemble
from islands.validation.prediction_bands import PredictionBands


def join_latent_results(data: CoupledSplit, results: Sequence[Result], steps: Steps) -> CoupledResult:
    """Return the result of the recommended latent model of every output.

    The outputs do not depend on each other, so that neither a common choice nor a common refinement could
    reduce an error. The bands of an output are those of its search.

    Parameters
    ----------
    data : CoupledSplit
    results : sequence of Result
        Result of every output, from the inputs alone.
    steps : Steps
        Steps that the result lacks, also those of the searches.
    """
    best = [result.best for result in results]
    if any(each.model.input_names != data.estimation.input_names for each in best):
        # An output responds to an input within the sample: the models share the columns.
        data = data.map(advance_all_inputs)
    inputs = data.estimation.input_names
    bands = [_name_inputs_of_bands(each.prediction_bands, inputs) for each in best if each.prediction_bands]
    return CoupledResult(
        CoupledLatentModel(tuple(_name_inputs(each.model, inputs) for each in best)),
        max(each.warm_up for each in best),
        tuple(bands) if len(bands) == len(best) else (),
        tuple(results),
        tuple(result.recommendation.rank for result in results),
        False,
        data,
        steps.left_out,
        steps.not_computed,
        refusal=steps.refusal,
    )


def _name_inputs(model: AnyModel | DynamicModel, inputs: tuple[str, ...]) -> LatentModel:
    """Return a latent model that reads its inputs from columns that are as early, or earlier.

    Raises
    ------
    ModelError
        The model is of another class.
    """
    if not isinstance(model, LatentModel):
        raise ModelError(f"a latent model is needed, this one is of the class {model.kind}")
    return replace(model, input_names=inputs)


def _name_inputs_of_bands(bands: PredictionBands, inputs: tuple[str, ...]) -> PredictionBands:
    """Return bands whose ensemble reads its inputs from these columns."""
    structures = (replace(each, model=_name_inputs(each.model, inputs)) for each in bands.ensemble.structures)
    return replace(bands, ensemble=Ensemble(tuple(structures)))
