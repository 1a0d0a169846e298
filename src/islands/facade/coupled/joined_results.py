"""Latent models of separate searches of several outputs as one model."""

from collections.abc import Sequence
from dataclasses import replace

from islands.errors import ModelError
from islands.evolution.search_result import require_one_output
from islands.facade.coupled.joint_models import JointCandidate
from islands.facade.results.identification import Result
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.records.coupled import CoupledSplit
from islands.records.input_lead import advance_all_inputs
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.ensemble import Ensemble
from islands.validation.evidence import measure_size
from islands.validation.prediction_bands import OutputBands, PredictionBands


def couple_latent_results(data: CoupledSplit, results: Sequence[Result]) -> JointCandidate:
    """Return the recommended latent models of all outputs as one model.

    The outputs do not depend on each other, so that neither a common choice nor a common refinement could
    reduce an error. The bands of an output are those of its search.

    Parameters
    ----------
    data : CoupledSplit
    results : sequence of Result
        Result of every output, from the inputs alone.
    """
    best = [require_one_output(result.search_result).recommended for result in results]
    models = [each.final_model for each in best]
    if any(each.input_names != data.estimation.input_names for each in models):
        # An output responds to an input within the sample: the models share the columns.
        data = data.map(advance_all_inputs)
    inputs = data.estimation.input_names
    bands = [_name_inputs_of_bands(each.bands, inputs) for each in best if each.bands]
    assessed = CoupledAssessment(
        CoupledLatentModel(tuple(_name_inputs(each, inputs) for each in models)),
        data,
        max(each.warm_up for each in best),
        refined=False,
        ranks=tuple(result.recommendation.rank for result in results),
        structure="one latent model for each output",
        size=sum(map(measure_size, models)),
    )
    return JointCandidate(
        assessed,
        lambda: OutputBands(tuple(bands)) if len(bands) == len(best) else None,
        tuple(results),
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
