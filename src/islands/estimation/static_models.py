"""Static models: the output depends on the inputs of the same sample only.

They are latent models of order 0, whose output is a weighted sum of inputs and a few curves of them, and
equations of the terms of a library that read no output, with logarithms and reciprocals. Curves have scales
of their own, equations products.
"""

from collections.abc import Iterator

import numpy as np

from islands.estimation.curve_models import add_curves
from islands.estimation.estimate import estimate
from islands.estimation.fitted_state_space import Draft, FittedStateSpace
from islands.estimation.forward_selection import find_simplest, make_selection_problem, select_forward
from islands.estimation.latent_data import LatentData, make_latent_data
from islands.estimation.latent_models import estimate_models, find_front
from islands.estimation.model_cache import share_models
from islands.estimation.structure_selection.certificate import SubsetSearch
from islands.estimation.structure_selection.deviations import find_offsets
from islands.estimation.structure_selection.input_ranking import screen_candidates
from islands.expressions.primitives import MUL, PRIMITIVES
from islands.expressions.tree import Apply, Constant, Expression, Lagged
from islands.models.candidate_library import get_library
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.models.narx import Model, canonical_order
from islands.models.regressor import regressor
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome

#: Curves of a model, or terms of an equation, at most.
_TERMS = 10

#: Steps of the estimation of gains.
_STEPS = 10

#: Library of the terms.
_LIBRARY = "magnitude"

_ONE = Constant(1.0)


@share_models
def identify_static_models(record: Dataset, steps: Steps) -> list[LatentModel | Model]:
    """Identify static models of increasing size.

    Parameters
    ----------
    record : Dataset
        Record without missing values, all inputs of which are read one sample early.
    steps : Steps
        Receives what is estimated, and may stop.

    Returns
    -------
    list of LatentModel or Model
        Gains alone, then models with curves, each with a smaller held-out error than all smaller ones, then
        the equation of every number of terms with the least error.

    Raises
    ------
    RecordError
        The record is too short.
    StoppedError
        A stop is requested.
    """
    data = make_latent_data(record)
    found = [_begin(data).estimate(data)]
    systems = [each for each in found if isinstance(each, FittedStateSpace)]
    for curves in range(_TERMS):
        best = find_front(systems)[-1:]
        if any(len(each.units) < curves for each in best):
            break  # The last curve gained nothing.
        systems += add_curves(best, data, steps=steps)
    return [*estimate_models(find_front(systems), record, steps), *_fit_equations(record)]


def _begin(data: LatentData) -> Draft:
    """Return a draft of a gain of every input, which begins at zero."""
    layout = StateSpaceLayout(0, data.record.inputs, 0)
    size = len(layout.names)
    return Draft(layout, (), np.zeros(size), np.ones(size, bool), np.zeros((len(data.used), 0)), _STEPS)


def _fit_equations(record: Dataset) -> list[Model]:
    """Return the equations of terms that read inputs at lag 1 only."""
    library = screen_candidates(_LIBRARY, get_library(_LIBRARY).degree, 1, record)
    static = (item for item in library if all(channel for channel, _ in item.lags))
    further = (item for each in _list_functions(record) if (item := regressor(each)[1]))
    problem = make_selection_problem(canonical_order([*static, *further]), record)
    if isinstance(problem, EvaluationOutcome):
        return []
    simplest = find_simplest(problem)
    structures = {
        tuple(canonical_order({simplest.get(item, item) for item in structure}))
        for structure in SubsetSearch(problem, _TERMS).structures or select_forward(problem, _TERMS)
    }
    found = [estimate(structure, record) for structure in sorted(structures, key=len)]
    return [each.model for each in found if not isinstance(each, EvaluationOutcome)]


def _list_functions(record: Dataset) -> Iterator[Expression]:
    """Yield logarithms and reciprocals of inputs that do not reach zero, and products with them."""
    offsets = find_offsets(record)[1:]
    signals = [Lagged(channel, 1) for channel in range(1, record.inputs + 1)]
    for signal in (each for each, offset in zip(signals, offsets, strict=True) if offset):
        logarithm, inverse = Apply(PRIMITIVES["log"], (signal,)), Apply(PRIMITIVES["div"], (_ONE, signal))
        yield from (logarithm, inverse)
        yield from (Apply(MUL, (each, each)) for each in (logarithm, inverse))
        yield from (Apply(MUL, (logarithm, other)) for other in signals)
        yield from (Apply(MUL, (inverse, other)) for other in signals if other != signal)
