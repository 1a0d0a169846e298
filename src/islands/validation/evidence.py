"""Evidence of models: the information criterion of their free runs on all data.

The criterion is the logarithm of the mean squared error, and a penalty for every parameter (Schwarz, Annals
of Statistics 6 (1978) 461-464) and for the choice of every term among many (Chen & Chen, Biometrika 95 (2008)
759-771). Errors that follow each other are correlated: the number of independent ones counts. The data from
which the parameters are estimated count as well: after one step or one bump, the rest of the record has no
excitation, and a constant is as good there as any model.
"""

from collections.abc import Sequence
from math import isqrt, log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.expressions.tree import Constant, Lagged
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.records.channel_names import parse_channel_name

_ONE = Constant(1.0)


def is_linear(model: AnyModel) -> bool:
    """Return whether the next output of a model is linear in its inputs and its states."""
    if isinstance(model, CoupledModel):
        return all(map(is_linear, model.models))
    if isinstance(model, LatentModel):
        return not model.units
    return isinstance(model, Model) and all(
        isinstance(item.expression, Lagged | Constant) for item in model.regressors
    )


def is_static(model: AnyModel) -> bool:
    """Return whether the output of a model depends on the inputs of the same sample only, and on one."""
    if isinstance(model, CoupledModel):
        return all(map(is_static, model.models))
    if isinstance(model, LatentModel):
        return not model.order and not any(model.delays) and reads_inputs(model)
    if not isinstance(model, Model):
        return False
    now = {(place, 1) for place, name in enumerate(model.input_names, 1) if parse_channel_name(name).at_once}
    lags = {each for item in model.regressors for each in item.lags}
    return bool(lags) and lags <= now


def name_form(model: AnyModel) -> str:
    """Return the form of a model.

    It is ``static``, ``linear``, ``curve`` (linear with one), ``equation`` or ``state space``.
    """
    if is_static(model):
        return "static"
    if is_linear(model):
        return "linear"
    if isinstance(model, LatentModel):
        return "curve" if len(model.units) == 1 else "state space"
    return "equation"


def reads_inputs(model: AnyModel) -> bool:
    """Return whether the output of a model depends on an input."""
    if isinstance(model, CoupledModel):
        return any(map(reads_inputs, model.models))
    if isinstance(model, LatentModel):
        blocks = model.layout.split(model.theta)
        return any(block.any() for block in (blocks["B"], blocks["D"], blocks["W"][:, model.order :]))
    return isinstance(model, Model) and any(channel for item in model.regressors for channel, _ in item.lags)


def measure_size(model: AnyModel) -> float:
    """Return the number of terms by which models are compared; a constant is half a term.

    The zero of a unit decides whether a law has a constant: in another unit, the law with one more term is
    still larger, and without an offset the law without a constant is smaller.
    """
    if isinstance(model, CoupledModel):
        return sum(map(measure_size, model.models))
    has_constant = isinstance(model, Model) and any(item.expression == _ONE for item in model.regressors)
    has_level = isinstance(model, LatentModel) and not model.units
    return model.free_size - 0.5 * (has_constant or has_level)


def count_effective(errors: NDArray[np.float64], samples: int) -> float:
    """Return how many of the samples are independent, by the autocorrelation of errors; NaN is left out.

    The variance of a mean of squares of correlated normal values is that of so many independent ones.
    """
    known = errors[~np.isnan(errors)]
    power, lags = float(np.add.reduce(known**2)), range(1, isqrt(known.size) + 1)
    if not power > 0.0:
        return float(samples)
    correlations = [float(np.add.reduce(known[lag:] * known[:-lag])) / power for lag in lags]
    return max(2.0, samples / (1.0 + 2.0 * sum(each**2 for each in correlations)))


def count_terms(models: Sequence[AnyModel]) -> int:
    """Return the number of terms among which the equations of models choose."""
    return len({name for model in models for name in _list_terms(model)})


def measure_lack(
    models: Sequence[AnyModel],
    sizes: Sequence[float],
    squares: ArrayLike,
    samples: float,
    terms: int,
) -> NDArray[np.float64]:
    """Return the information criteria of models, less of one with more evidence.

    Parameters
    ----------
    models : sequence of AnyModel
    sizes : sequence of float
        As of `measure_size`.
    squares : array of shape (models,)
        Mean squared errors of the free runs, positive.
    samples : float
        Number of independent errors.
    terms : int
        Number of terms among which equations choose. A curve is chosen among about as many.
    """
    choices = np.array([_count_choices(model) for model in models])
    chosen: NDArray[np.float64] = 2.0 * log(max(1, terms)) * choices
    return samples * np.log(squares) + log(samples) * np.asarray(sizes) + chosen


def _list_terms(model: AnyModel) -> Sequence[str]:
    """Return the terms of an equation, which are chosen among others."""
    return model.parameter_names if isinstance(model, Model) else ()


def _count_choices(model: AnyModel) -> int:
    """Return how many terms of a model, or curves, are chosen among others."""
    if is_linear(model):
        return 0
    if isinstance(model, CoupledModel):
        return sum(map(_count_choices, model.models))
    return len(model.units) if isinstance(model, LatentModel) else len(_list_terms(model))
