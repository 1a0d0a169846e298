"""Error metrics of a prediction, and information criteria.

Equations (7) and (8) refer to the paper. The fit is defined as in system identification toolboxes.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError


@dataclass(frozen=True, slots=True)
class Metrics:
    """Error metrics of a prediction.

    Attributes
    ----------
    mape : float
        Equation (7), in per cent. Despite its name in the paper, it is the mean absolute error in per cent of
        the measured range, not a mean of relative errors.
    r2 : float
        Equation (8): 1 for a perfect prediction, 0 if it is as good as the mean, negative if it is worse.
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
    """Prediction error penalised by the number of parameters; lower is better.

    Values are only comparable between models estimated from the same samples.

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
    """Compute the error metrics of a prediction.

    Samples with a NaN in either array (warm-up, missing output) are ignored. If no sample remains, all
    metrics are NaN. If the compared output is constant, ``r2`` and ``fit_percent`` are NaN, and ``mape`` is
    NaN unless a range is given. A prediction whose squared error overflows has an infinite error, without a
    warning.

    Parameters
    ----------
    measured, predicted : ndarray, shape (samples,)
        Output ``y`` and prediction ``yhat``, in the same unit.
    output_range : float, optional
        Scale of equation (7). The default is ``max y - min y`` over the compared measured samples. Give the
        range of a whole record to use the same scale for its parts. With 0, ``mape`` is NaN.

    Raises
    ------
    SettingsError
        The arrays are not one-dimensional or differ in length, or the range is negative.
    """
    y = np.asarray(measured, dtype=np.float64)
    yhat = np.asarray(predicted, dtype=np.float64)
    if y.ndim != 1 or y.shape != yhat.shape:
        raise SettingsError(f"compare two (samples,) arrays of one length, got {y.shape} and {yhat.shape}")
    if output_range is not None and output_range < 0.0:
        raise SettingsError(f"the output range is max - min and never negative, got {output_range}")
    valid = ~(np.isnan(y) | np.isnan(yhat))
    y, yhat = y[valid], yhat[valid]
    if not len(y):
        return Metrics(math.nan, math.nan, math.nan, math.nan)
    with np.errstate(over="ignore", invalid="ignore"):
        return _compute_metrics(y, yhat, output_range)


def _compute_metrics(
    y: NDArray[np.float64], yhat: NDArray[np.float64], output_range: float | None
) -> Metrics:
    spread = float(y.max() - y.min())
    scale = spread if output_range is None else output_range
    # Scale by the range so that squares do not underflow in any unit. The range also detects a constant
    # output; the squared deviations of equal samples from their rounded mean are about 1e-34, not 0.
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
    """Compute the information criteria of a one-step-ahead residual.

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
        Number of estimated parameters, minus the number of imposed constraints.

    Raises
    ------
    SettingsError
        There are not more samples than parameters, or an argument is negative.
    """
    if parameters < 0 or residual_sum_of_squares < 0.0:
        raise SettingsError(
            "a sum of squares and a number of parameters are never negative, "
            f"got {residual_sum_of_squares} and {parameters}"
        )
    if samples <= parameters:
        raise SettingsError(
            f"{samples} samples are too few for {parameters} parameters: take more samples or a smaller model"
        )
    if residual_sum_of_squares == 0.0:
        return InformationCriteria(-math.inf, -math.inf, 0.0)
    deviance = samples * (math.log(residual_sum_of_squares) - math.log(samples))
    return InformationCriteria(
        aic=deviance + 2.0 * parameters,
        bic=deviance + parameters * math.log(samples),
        fpe=residual_sum_of_squares / samples * (samples + parameters) / (samples - parameters),
    )
