"""How far a prediction lies from the measurement, and what each parameter has to earn.

Equations (7) and (8) are the paper's; the fit is that of the system identification toolboxes.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError


@dataclass(frozen=True, slots=True)
class Metrics:
    """Distance of a prediction from the measurement.

    Attributes
    ----------
    mape : float
        Equation (7), in per cent. It is a mean absolute error in per cent of the measured range, not a mean
        of relative errors; the paper's name is kept.
    r2 : float
        Equation (8): 1 for a perfect prediction, 0 for one no better than the mean, negative for a worse one.
    rmse : float
        Root of the mean squared error, in the unit of the output.
    fit_percent : float
        ``100 (1 - ||y - yhat|| / ||y - mean y||)``, in per cent: 100 for a perfect prediction.
    """

    mape: float
    r2: float
    rmse: float
    fit_percent: float


@dataclass(frozen=True, slots=True)
class InformationCriteria:
    """Prediction error weighed against the number of parameters; the lowest is the best.

    Only differences between models estimated from the same samples mean anything.

    Attributes
    ----------
    aic : float
        Akaike's information criterion.
    bic : float
        Schwarz's (Bayesian) information criterion.
    fpe : float
        Akaike's final prediction error, in the squared unit of the output.
    """

    aic: float
    bic: float
    fpe: float


def metrics(
    measured: NDArray[np.float64], predicted: NDArray[np.float64], output_range: float | None = None
) -> Metrics:
    """Compare a prediction with the measurement, sample by sample.

    Pairs with a NaN on either side (warm-up, missing output) are left out; if none is left, all is NaN. Where
    the compared output is constant, ``r2``, ``fit_percent`` and (unless a range is given) ``mape`` are NaN.
    A prediction that grows past what a float can square counts as infinitely wrong: no warning is given.

    Parameters
    ----------
    measured, predicted : ndarray, shape (samples,)
        Output ``y`` and prediction ``yhat``, in the same unit.
    output_range : float, optional
        The scale of equation (7). By default ``max y - min y`` over the measured samples that are compared;
        give the range of a whole record to put several of its parts on one scale. 0 makes ``mape`` NaN.

    Raises
    ------
    SettingsError
        The arrays are not one-dimensional and of one length, or the range is negative.
    """
    y = np.asarray(measured, dtype=np.float64)
    yhat = np.asarray(predicted, dtype=np.float64)
    if y.ndim != 1 or y.shape != yhat.shape:
        raise SettingsError(f"compare two (samples,) arrays of one length, got {y.shape} and {yhat.shape}")
    if output_range is not None and output_range < 0.0:
        raise SettingsError(f"the output range is max - min and never negative, got {output_range}")
    there = ~(np.isnan(y) | np.isnan(yhat))
    y, yhat = y[there], yhat[there]
    if not len(y):
        return Metrics(math.nan, math.nan, math.nan, math.nan)
    with np.errstate(over="ignore", invalid="ignore"):
        return _compared(y, yhat, output_range)


def _compared(y: NDArray[np.float64], yhat: NDArray[np.float64], output_range: float | None) -> Metrics:
    spread = float(y.max() - y.min())
    scale = spread if output_range is None else output_range
    # In units of the range, so that no unit of measurement underflows when squared. The range also tells what
    # is constant: about their rounded mean, equal samples leave squares of 1e-34, not 0.
    unit = spread if spread > 0.0 else 1.0
    error, deviation = (y - yhat) / unit, (y - y.mean()) / unit
    squared = float(np.add.reduce(error * error))
    ratio = squared / float(np.add.reduce(deviation * deviation)) if spread > 0.0 else math.nan
    return Metrics(
        mape=100.0 * unit * float(np.abs(error).mean()) / scale if scale > 0.0 else math.nan,
        r2=1.0 - ratio,
        rmse=unit * math.sqrt(squared / len(y)),
        fit_percent=100.0 * (1.0 - math.sqrt(ratio)),
    )


def information_criteria(
    residual_sum_of_squares: float, samples: int, parameters: int
) -> InformationCriteria:
    """Weigh a one-step-ahead residual against the number of parameters that made it.

    With ``N`` samples, ``p`` parameters and Gaussian noise of unknown variance, up to a common constant::

        AIC = N log(rss / N) + 2 p              Akaike, IEEE Trans. Automatic Control 19 (1974) 716-723
        BIC = N log(rss / N) + p log N          Schwarz, Annals of Statistics 6 (1978) 461-464
        FPE = rss / N * (N + p) / (N - p)       Akaike, Ann. Inst. Statist. Math. 22 (1970) 203-217

    A residual of exactly zero gives ``AIC = BIC = -inf`` and ``FPE = 0``; NaN gives NaN.

    Parameters
    ----------
    residual_sum_of_squares : float
        ``rss``, the sum of squared residuals over the estimation samples, in the squared unit of the output.
    samples : int
        Number of residuals in that sum.
    parameters : int
        Number of estimated parameters; constraints that were imposed each take one away.

    Raises
    ------
    SettingsError
        There are not more samples than parameters, or a negative number was given.
    """
    if parameters < 0 or residual_sum_of_squares < 0.0:
        raise SettingsError(
            "a sum of squares and a number of parameters are never negative, "
            f"got {residual_sum_of_squares} and {parameters}"
        )
    if samples <= parameters:
        raise SettingsError(
            f"{samples} samples cannot judge {parameters} parameters: take more samples or a smaller model"
        )
    if residual_sum_of_squares == 0.0:
        return InformationCriteria(-math.inf, -math.inf, 0.0)
    deviance = samples * (math.log(residual_sum_of_squares) - math.log(samples))
    return InformationCriteria(
        aic=deviance + 2.0 * parameters,
        bic=deviance + parameters * math.log(samples),
        fpe=residual_sum_of_squares / samples * (samples + parameters) / (samples - parameters),
    )
