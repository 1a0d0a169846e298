"""Prediction bands of a model of several outputs."""

from collections.abc import Iterator, Sequence
from functools import partial

from islands.estimation.estimator_table import refinement_criterion
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import Model
from islands.progress import Steps
from islands.records.coupled import CoupledSplit
from islands.validation.ensemble import (
    ValidatedModel,
    make_ensemble,
    measure_square,
)
from islands.validation.prediction_bands import OutputBands, calibrate_output_bands

#: Name of the step.
_BANDS = "prediction bands"

#: Error whose block bootstrap gives the parameters of the members.
_CRITERION = refinement_criterion(None)


def make_bands(
    model: CoupledModel,
    ranked: Sequence[Sequence[Model]],
    ranks: Sequence[int],
    data: CoupledSplit,
    constraints: str,
    warm_up: int,
    seed: int,
    steps: Steps,
) -> OutputBands | None:
    """Return the prediction bands of every output; None if the model diverges, or the step is missing.

    The ensemble has the structure of the model, and those in which one equation is another of its output. The
    parameters of its members are from a block bootstrap of the error of the common free run.

    Parameters
    ----------
    model : CoupledModel
        Chosen equations, with their final parameters.
    ranked : sequence of sequence of Model
        Models of every output, best first.
    ranks : sequence of int
        Chosen rank of every output, from 1.
    data : CoupledSplit
    constraints : str
        Constraints of every equation.
    warm_up : int
        Number of samples before the first prediction.
    seed : int
    steps : Steps
        The bands are an optional step.
    """
    skip = partial(steps.skip, _BANDS)

    def compute() -> OutputBands | None:
        steps.report(_BANDS, 1.0)
        candidates = [
            ValidatedModel(each, _CRITERION, measure_square(each, data, warm_up))
            for each in _list_rivals(model, ranked, ranks)
        ]
        ensemble = make_ensemble(candidates, data, constraints, warm_up, seed, skip, model)
        if ensemble is None or skip():
            return None
        return calibrate_output_bands(model, ensemble, data, warm_up)

    return steps.attempt(_BANDS, compute)


def _list_rivals(
    model: CoupledModel, ranked: Sequence[Sequence[Model]], ranks: Sequence[int]
) -> Iterator[CoupledModel]:
    """Yield the model, and those with another equation for one of its outputs."""
    yield model
    for place, (models, chosen) in enumerate(zip(ranked, ranks, strict=True)):
        for rank, other in enumerate(models, start=1):
            if rank != chosen:
                yield CoupledModel((*model.models[:place], other, *model.models[place + 1 :]))
