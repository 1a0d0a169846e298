"""Linear model of the same data, whose error shows what the nonlinear terms of a model contribute."""

from collections.abc import Sequence

from islands.estimation.output_error import fit_output_error
from islands.expressions.tree import Constant, Lagged
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.records.split import Split
from islands.validation.assessment import Assessment, assess
from islands.validation.recommendation import measure_size, recommend

#: Largest lag of an input and of the output, and largest number of terms.
_LAGS, _MAX_TERMS = 4, 40


def is_linear(model: DynamicModel) -> bool:
    """Return whether the next output of a model is linear in its inputs and its states."""
    if isinstance(model, LatentModel):
        return not model.units
    return isinstance(model, Model) and all(
        isinstance(item.expression, Lagged | Constant) for item in model.regressors
    )


def fit_linear_comparison(split: Split, delays: Sequence[int], shooting: int) -> Assessment | None:
    """Fit linear models of increasing order to the free run, and return the recommended one.

    Parameters
    ----------
    split : Split
        Estimation data, and validation data that select the order.
    delays : sequence of int
        Dead time of each input in samples; none if empty.
    shooting : int
        Length of a multiple-shooting interval in samples.

    Returns
    -------
    Assessment or None
        None if the data are too short, or if every free run diverges.
    """
    found = [
        assess(each.model, split, shooting, criterion=each.criterion)
        for each in fit_output_error(split.estimation, delays, _LAGS, _MAX_TERMS)
    ]
    bounded = [each for each in found if each.outcomes["validation"]["free_run"]]
    if not bounded:
        return None
    sizes = [measure_size(each.model) for each in bounded]
    return bounded[recommend(sizes, bounded, hysteresis=False).rank - 1]
