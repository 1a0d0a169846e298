"""Evidence of models: the information criterion of their free runs on all data.

The criterion is the logarithm of the mean square of the whitened errors, and a penalty for every parameter
(Schwarz, Annals of Statistics 6 (1978) 461-464) and for the choice of every term among many (Chen & Chen,
Biometrika 95 (2008) 759-771). The noise model that whitens is that of the closest model, for all of them: a
slow error counts little where the noise is slow, and much where it is white. The data from which the
parameters are estimated count as well: after one step or one bump, the rest of the record has no excitation,
and a constant is as good there as any model.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.expressions.tree import Constant
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.form import is_linear
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.records.coupled import AnyRecord, CoupledRecord, CoupledSplit
from islands.records.noise_model import NoiseModel, fit_noise, white_noise
from islands.records.segments import count_runs
from islands.records.split import Split
from islands.rounding import RESOLUTION
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.predictors import Simulation

#: Difference of the evidence of two models that do not count as equal: very strong evidence (Kass & Raftery,
#: J. American Statistical Association 90 (1995) 773-795).
DECISIVE = 10.0

_ONE = Constant(1.0)


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


def join_errors(*parts: tuple[AnyRecord, Simulation]) -> NDArray[np.float64]:
    """Return the errors of the free runs on parts of the data, relative to the output ranges of the first.

    Parameters
    ----------
    *parts : tuple of Dataset or CoupledRecord, and Simulation

    Returns
    -------
    ndarray, shape (samples,) or (samples, outputs)
        NaN in the warm-up of a free run, infinite on a part whose free run diverged.
    """
    first = parts[0][0]
    records = first.records if isinstance(first, CoupledRecord) else (first,)
    ranges = np.array([each.output_range or 1.0 for each in records])
    errors = [record.y - run.y if run.outcome else np.full(record.y.shape, inf) for record, run in parts]
    relative: NDArray[np.float64] = np.concatenate(errors) / (
        ranges if isinstance(first, CoupledRecord) else ranges[0]
    )
    return relative


def measure_errors(model: AnyModel, split: Split | CoupledSplit, warm_up: int) -> NDArray[np.float64]:
    """Return the errors of the free runs of a model on both parts of the data; see `join_errors`."""
    parts = split.estimation, split.validation
    return join_errors(*((part, simulate_freely(model, part, warm_up)) for part in parts))


def mean_square(errors: NDArray[np.float64]) -> float:
    """Return the mean square of errors; infinite after a divergence.

    Errors below the resolution of files are equal. With several outputs, it is the geometric mean: the
    likelihood of independent normal errors with unknown variances depends on it.

    Parameters
    ----------
    errors : ndarray, shape (samples,) or (samples, outputs)
        As of `join_errors`.
    """
    squares = np.nanmean(np.square(errors), axis=0)
    return float(np.exp(np.mean(np.log(np.maximum(squares, RESOLUTION**2)))))


@dataclass(frozen=True, slots=True, eq=False)
class ErrorNoise:
    """Noise of the errors of free runs: what remains of them is compared between models.

    Attributes
    ----------
    models : tuple of NoiseModel
        Of every output.
    segments : tuple of int
        Lengths of the recordings in samples.
    samples : int
        Number of known errors of all outputs.
    """

    models: tuple[NoiseModel, ...]
    segments: tuple[int, ...]
    samples: int

    @classmethod
    def fit_closest(cls, errors: Iterable[NDArray[np.float64]], segments: Sequence[int]) -> "ErrorNoise":
        """Fit the noise of the closest of several models; see `fit`."""
        return cls.fit(min(errors, key=mean_square), segments)

    @classmethod
    def fit(cls, errors: NDArray[np.float64], segments: Sequence[int]) -> "ErrorNoise":
        """Fit the noise of every output.

        Parameters
        ----------
        errors : ndarray, shape (samples,) or (samples, outputs)
            Errors of the closest model, as of `join_errors`.
        segments : sequence of int
        """
        columns = errors.reshape(len(errors), -1).T
        known = np.isfinite(columns)
        models = (
            _fit_noise(column[each], count_runs(each, segments))
            for column, each in zip(columns, known, strict=True)
        )
        return cls(tuple(models), tuple(segments), int(np.count_nonzero(known)))

    def measure(self, errors: NDArray[np.float64]) -> float:
        """Return the mean square of whitened errors; infinite after a divergence.

        Errors below the resolution of files are equal. With several outputs, it is the geometric mean: the
        likelihood of independent normal errors with unknown variances depends on it.
        """
        logarithms = []
        for noise, column in zip(self.models, errors.reshape(len(errors), -1).T, strict=True):
            known = ~np.isnan(column)
            if not (known.any() and np.isfinite(column[known]).all()):
                return inf
            whitened = noise.whiten(column[known], count_runs(known, self.segments))
            logarithms.append(log(float(np.mean(whitened**2)) + RESOLUTION**2))
        return float(np.exp(np.mean(logarithms)))


def _fit_noise(errors: NDArray[np.float64], segments: Sequence[int]) -> NoiseModel:
    """Fit the noise of errors; those below the resolution of files are white."""
    square = float(np.mean(errors**2))
    if square <= RESOLUTION**2:
        return white_noise(square, errors.size)
    return fit_noise(errors, segments=segments)


def count_terms(models: Sequence[AnyModel]) -> int:
    """Return the number of terms among which the equations of models choose."""
    return len({name for model in models for name in _list_terms(model)})


def measure_lack(
    models: Sequence[AnyModel],
    sizes: Sequence[float],
    squares: ArrayLike,
    samples: int,
    terms: int,
) -> NDArray[np.float64]:
    """Return the information criteria of models, less of one with more evidence.

    Parameters
    ----------
    models : sequence of AnyModel
    sizes : sequence of float
        As of `measure_size`.
    squares : array of shape (models,)
        As of `ErrorNoise.measure`, positive.
    samples : int
        Number of errors.
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
