"""Covariance of estimated parameters that does not assume a white residual.

The estimate minimises a sum of squares, so its error is a weighted sum of the scores, the products of the
sensitivities and the residual. If the residual is coloured, the scores are correlated and the classical
formula, the residual variance times the inverse of J'J, is wrong. The sandwich covariance replaces the
variance of the scores by their long-run variance (White 1980; Newey and West 1987).

The long-run variance is estimated with the Parzen kernel and the automatic bandwidth of Andrews (1991,
Econometrica 59, equations 6.2 and 6.4). The Parzen kernel is the autocorrelation of a triangle, and the
triangle is a moving sum of a moving sum. The estimate therefore is the mean square of a smoothed series: it
is positive semidefinite and takes one pass over the rows, whatever the bandwidth.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.kernels.qr import orthogonalise
from islands.kernels.summation import dot

#: Largest absolute autocorrelation in the choice of the bandwidth (Andrews and Monahan 1992).
_MAX_AUTOCORRELATION = 0.97

#: The kernel covers at most this fraction of the rows.
_MAX_SUPPORT = 0.25

#: Number of shooting intervals from which on the scores are summed over each interval. With fewer intervals
#: the variance of the sums is too uncertain (Cameron and Miller 2015, section VI).
_MIN_INTERVALS = 30

#: The normal quantile of two-sided 95 % intervals, and its probability.
_QUANTILE, _PROBABILITY = 1.959963984540054, 0.975

#: A sensitivity that depends on the others up to this fraction of its norm is left out.
_DEPENDENT = 1e-11


def sandwich(
    sensitivities: NDArray[np.float64],
    residual: NDArray[np.float64],
    intervals: NDArray[np.int64] | None = None,
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the covariance of the coefficients of orthonormal sensitivities.

    The covariance is scaled for short records: by rows / (rows - coefficients), and such that 1.96 standard
    errors are the 95 % quantile of Student's distribution. Its degrees of freedom are those of the long-run
    variance (Kiefer and Vogelsang 2005 give the reason: the variance is estimated, too).

    Parameters
    ----------
    sensitivities : ndarray, shape (coefficients, rows)
        Derivatives of the prediction, orthonormal, with the rows in the order of time.
    residual : ndarray, shape (rows,)
    intervals : ndarray of int64, shape (intervals,), optional
        Numbers of rows of the shooting intervals, in the order of time. The residuals of one interval share
        its initial values, so the scores are summed over each interval.
    weights : ndarray, shape (coefficients, free), optional
        Orthonormal combinations of the sensitivities whose coefficients are estimated; all by default.

    Returns
    -------
    ndarray, shape (free, free)
    """
    weights = np.eye(len(sensitivities)) if weights is None else weights
    rows, count = residual.size, weights.shape[1]
    if not count:
        return np.zeros((0, 0))
    scores = sensitivities * residual
    if intervals is not None and _MIN_INTERVALS <= len(intervals) < rows:
        ends = np.cumsum(intervals) - 1
        scores = np.diff(np.cumsum(scores, axis=1)[:, ends], axis=1, prepend=0.0)
    covariance, freedom = long_run_variance(np.ascontiguousarray(scores), weights)
    freedom = max(1.0, min(freedom, rows - count))
    student = float(scipy.special.stdtrit(freedom, _PROBABILITY)) / _QUANTILE
    corrected: NDArray[np.float64] = covariance * (rows / max(1, rows - count) * student**2)
    return corrected


def sandwich_of_jacobian(
    jacobian: NDArray[np.float64], residual: NDArray[np.float64], intervals: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """Return the `sandwich` covariance of coefficients with any Jacobian, shape (coefficients, rows).

    A coefficient whose sensitivity is zero or a combination of those before it has variance zero.
    """
    count = len(jacobian)
    kept = list(range(count))
    while kept:
        q, ignored = np.ascontiguousarray(jacobian[kept]), np.array(residual)
        triangle, projection = np.empty((len(kept), len(kept))), np.empty(len(kept))
        dependent = orthogonalise(q, ignored, triangle, projection, _DEPENDENT)
        if dependent < 0:
            break
        del kept[dependent]
    covariance: NDArray[np.float64] = np.zeros((count, count))
    if kept:
        inner = sandwich(q, residual, intervals)
        half = scipy.linalg.solve_triangular(triangle, inner)
        covariance[np.ix_(kept, kept)] = scipy.linalg.solve_triangular(triangle, half.T)
    return covariance


def long_run_variance(
    scores: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the sum of the autocovariances of series that sum to zero, times their length.

    Parameters
    ----------
    scores : ndarray, shape (series, rows)
    weights : ndarray, shape (series, combinations)
        The variance is that of ``weights.T @ scores``, which is never stored.

    Returns
    -------
    variance : ndarray, shape (combinations, combinations)
        Variance of the sum over the rows.
    freedom : float
        Degrees of freedom of the estimate.
    """
    count, rows = scores.shape
    length = _window(scores, weights)
    smooth = np.ascontiguousarray(_moving_sum(_moving_sum(scores, length), length))
    triangle = np.convolve(np.ones(length), np.ones(length))
    kernel = np.convolve(triangle, triangle)
    kernel /= kernel.max()
    flat, samples = smooth.reshape(-1), smooth.shape[1]
    variance: NDArray[np.float64] = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            variance[i, j] = variance[j, i] = dot(flat, i * samples, flat, j * samples, samples)
    # The scores sum to zero, which takes the share of the weights from the expected value.
    share = 1.0 - float(kernel.sum()) / rows if length > 1 else 1.0
    combined: NDArray[np.float64] = weights.T @ variance @ weights
    return combined / (triangle @ triangle) / share, rows / float(kernel @ kernel)


def _window(scores: NDArray[np.float64], weights: NDArray[np.float64]) -> int:
    """Return half the support of the Parzen kernel in rows; 1 uses no autocovariance."""
    numerator = denominator = 0.0
    for value in _autocorrelations(scores, weights):
        rho = min(max(value, -_MAX_AUTOCORRELATION), _MAX_AUTOCORRELATION)
        innovation = (1.0 - rho**2) ** 2
        numerator += 4.0 * rho**2 * innovation / (1.0 - rho) ** 8
        denominator += innovation / (1.0 - rho) ** 4
    if not numerator > 0.0:
        return 1
    rows = scores.shape[1]
    support = 2.6614 * (numerator / denominator * rows) ** 0.2
    return max(1, int(np.ceil(min(support, _MAX_SUPPORT * rows) / 2.0)))


def _autocorrelations(scores: NDArray[np.float64], weights: NDArray[np.float64]) -> list[float]:
    """Return the autocorrelations at lag 1 of the principal combinations of the weighted series.

    They do not depend on the basis of the series, hence not on units or on the basis of a null space.
    """
    count, rows = scores.shape
    if rows < 2:
        return []
    flat = np.ascontiguousarray(scores).reshape(-1)
    present, shifted = np.empty((count, count)), np.empty((count, count))
    for i in range(count):
        for j in range(count):
            if j <= i:
                present[i, j] = present[j, i] = dot(flat, i * rows, flat, j * rows, rows)
            shifted[i, j] = dot(flat, i * rows, flat, j * rows + 1, rows - 1)
    present, shifted = (weights.T @ matrix @ weights for matrix in (present, shifted + shifted.T))
    energies, vectors = np.linalg.eigh(present)
    kept = energies > _DEPENDENT * max(energies[-1], 0.0)
    white = vectors[:, kept] / np.sqrt(energies[kept])
    values: list[float] = np.linalg.eigvalsh(white.T @ shifted @ white / 2.0).tolist()
    return values


def _moving_sum(series: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Return the sums over all windows that overlap the series, which is zero outside."""
    count, rows = series.shape
    running = np.zeros((count, rows + 2 * length - 1))
    np.cumsum(series, axis=1, out=running[:, length : length + rows])
    running[:, length + rows :] = running[:, length + rows - 1, None]
    return running[:, length:] - running[:, :-length]
