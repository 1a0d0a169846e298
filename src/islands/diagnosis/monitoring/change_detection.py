"""Detection of a change in a sequence of values with a given rate of false alarms.

The likelihood-ratio test of one step of the mean at any earlier record, repeated after every record (Hawkins,
Qiu and Kang, The changepoint model for statistical process control, Journal of Quality Technology 35, 2003).
Mean and variance before the step are unknown, so that the length of the training changes the power of the
test and not its rate of false alarms. Values are clipped at robust limits, and autocorrelation is removed.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.effects.interface.context import Signal
from islands.rounding import NORMAL_MEDIAN

#: Limit of a value, in robust standard deviations of the training about its median. One record with an
#: outlier is no change.
CLIP = 4.0

#: Number of successive records beyond the limit that are no outliers.
RUN = 3

#: Smallest number of records after a change.
MIN_CHANGED = 2

#: Largest autocorrelation that is removed.
MAX_AUTOCORRELATION = 0.9

#: Number of latest records at which a change may have begun.
WINDOW = 1000

#: Decay of the overshoot factor of a random walk, nu(x) = exp(-0.583 x) (Siegmund, Sequential Analysis, 1985,
#: equation 4.38), and the integral of x nu(x)^2.
_OVERSHOOT = 2 * 0.583
_INTEGRAL = 1.0 / _OVERSHOOT**2


def compute_alarm_rate(threshold: float) -> float:
    """Return the rate of false alarms of one sequence, per record, at a threshold.

    Siegmund and Venkatraman, Using the generalized likelihood ratio statistic for sequential detection of a
    change-point, Annals of Statistics 23, 1995, theorem 1, for a change in either direction.
    """
    density = float(np.exp(-(threshold**2) / 2) / np.sqrt(2 * np.pi))
    return threshold * density * _INTEGRAL


def find_threshold(rate: float) -> float:
    """Return the threshold, in standard deviations, that gives one sequence a rate of false alarms."""
    highest = 1.0  # the rate falls from here on
    if rate >= compute_alarm_rate(highest):
        return highest
    return float(scipy.optimize.brentq(lambda each: compute_alarm_rate(each) - rate, highest, 35.0))


def limit_values(values: Signal, errors: Signal, training: int, clip: float = CLIP) -> Signal:
    """Standardise sequences by the median and the deviation of their training, and clip them.

    The variance of a value is that between records plus the square of its standard error: records differ by
    more than their noise, and some of them determine a value less than others.

    Parameters
    ----------
    values, errors : ndarray, shape (records, sequences)
        Values and their standard errors; zero if they are unknown.
    training : int
        Number of first records in which nothing changes.
    clip : float

    Returns
    -------
    ndarray, shape (records, sequences)
        Zero for a sequence that is constant during the training.
    """
    first = values[:training]
    centre = np.median(first, axis=0)
    deviation = np.median(np.abs(first - centre), axis=0) / NORMAL_MEDIAN
    # A value at a bound in most records has a median deviation of zero.
    deviation = np.where(deviation > 0.0, deviation, np.std(first, axis=0))
    is_constant = deviation <= 1e-9 * np.max(np.abs(first), axis=0)
    between = np.maximum(deviation**2 - np.median(errors[:training], axis=0) ** 2, 0.0)
    scale = np.sqrt(between + errors**2)
    standardised = (values - centre) / np.where(is_constant | (scale == 0.0), 1.0, scale)
    limited = _limit(np.maximum(standardised, 0.0), clip) - _limit(np.maximum(-standardised, 0.0), clip)
    return np.where(is_constant, 0.0, limited)


def _limit(sizes: Signal, clip: float) -> Signal:
    """Limit sizes, except in runs: a size counts up to the smallest one of `RUN` successive records."""
    if len(sizes) < RUN:
        return np.minimum(sizes, clip)
    lowest = np.min(np.lib.stride_tricks.sliding_window_view(sizes, RUN, axis=0), axis=-1)
    around = np.pad(lowest, ((RUN - 1, RUN - 1), (0, 0)))
    highest = np.max(np.lib.stride_tricks.sliding_window_view(around, RUN, axis=0), axis=-1)
    return np.minimum(sizes, np.maximum(highest, clip))


def test_steps(limited: Signal, training: int, autocorrelation: Signal) -> Signal:
    """Test for a step of the mean that begins at each record after the training.

    Parameters
    ----------
    limited : ndarray, shape (records, sequences)
    training : int
    autocorrelation : ndarray, shape (sequences,)
        Correlation of successive values, which generalised least squares accounts for.

    Returns
    -------
    ndarray, shape (records - training - MIN_CHANGED + 1, sequences)
        Signed statistic, standard normal without a change; at most `WINDOW` rows.
    """
    count, last = len(limited), len(limited) - MIN_CHANGED + 1
    rho = autocorrelation
    rest = 1.0 - rho
    white = np.concatenate([limited[:1] * np.sqrt(1.0 - rho**2), limited[1:] - rho * limited[:-1]])
    first = max(training, last - WINDOW)
    after = (count - 1.0 - np.arange(first, last))[:, None]
    sums = np.cumsum(white[::-1], axis=0)[::-1]
    # Inner products of the step h, the constant c and the values e, all of them whitened.
    he = white[first:last] + rest * (sums[first:last] - white[first:last])
    hc, hh = rest + rest**2 * after, 1.0 + rest**2 * after
    cc = (1.0 - rho**2) + rest**2 * (count - 1)
    ce = np.sqrt(1.0 - rho**2) * white[0] + rest * (sums[0] - white[0])
    remaining = np.sum(white**2, axis=0) - ce**2 / cc
    product = he - hc * ce / cc
    explained = product**2 / (hh - hc**2 / cc)
    freedom = count - 3
    unexplained = np.maximum(remaining - explained, np.finfo(float).tiny)
    student = np.sqrt(freedom * explained / unexplained)
    normal = np.minimum(-scipy.special.ndtri(scipy.special.stdtr(freedom, -student)), 35.0)
    return np.where(remaining > 0.0, np.sign(product) * np.nan_to_num(normal, posinf=35.0), 0.0)


def estimate_autocorrelation(limited: Signal, training: int) -> Signal:
    """Estimate an upper limit of the correlation of successive values, shape (sequences,).

    The best step is removed first, and a line after it, since a change would be taken for correlation. The
    limit is one standard error above the estimate: an autocorrelation that is too low multiplies false
    alarms, one that is too high only delays true ones. Values that drift slowly below a larger scatter have
    little correlation of neighbours; the variance of sums over many records shows it.
    """
    count = len(limited)
    steps = test_steps(limited, training, np.zeros(limited.shape[1]))
    start = count - MIN_CHANGED + 1 - len(steps) + np.argmax(np.abs(steps), axis=0)
    is_after = np.arange(count)[:, None] >= start
    residual = _remove_line(limited - _average(limited, ~is_after) * ~is_after, is_after)
    is_pair = is_after[1:] == is_after[:-1]
    energy = np.maximum(np.sum(residual**2, axis=0), np.finfo(float).tiny)
    neighbours = np.sum(residual[1:] * residual[:-1] * is_pair, axis=0) / energy
    rho = neighbours + 2.0 * (1.0 + 3.0 * neighbours) / count  # bias of two estimated means (Kendall, 1954)
    limit = rho + np.sqrt(np.maximum(1.0 - rho**2, 0.0) / count)
    ratio = _estimate_variance_ratio(residual, energy / count)
    # The coefficient a for which x(k) - a x(k-1) has the same variance in single values and in long sums:
    # ratio (1 - a)^2 = 1 + a^2 - 2 a neighbours; for an autoregression of first order a = neighbours.
    half, square = ratio - neighbours, np.maximum(ratio - 1.0, 1e-9)
    of_sums = (half - np.sqrt(np.maximum(half**2 - square**2, 0.0))) / square
    return np.clip(np.maximum(limit, of_sums), 0.0, MAX_AUTOCORRELATION)


def _estimate_variance_ratio(residual: Signal, variance: Signal) -> Signal:
    """Estimate the variance of sums relative to that of independent values, with one standard error."""
    count = len(residual)
    sums = np.concatenate([np.zeros((1, residual.shape[1])), np.cumsum(residual, axis=0)])
    ratio = np.ones(residual.shape[1])
    length = 2
    while length <= max(4.0, count**0.5):
        own = np.mean((sums[length:] - sums[:-length]) ** 2, axis=0) / (length * variance)
        own = own / (1.0 - 2.0 * length / count)  # two means are removed
        ratio = np.maximum(ratio, own * (1.0 + np.sqrt(4.0 * length / (3.0 * count))))
        length *= 2
    return ratio


def compute_statistics(values: Signal, errors: Signal, training: int) -> tuple[Signal, NDArray[np.int64]]:
    """Compute the test statistic of each sequence after its last record.

    Parameters
    ----------
    values, errors : ndarray, shape (records, sequences)
        As of `limit_values`, with at least `MIN_CHANGED` records after the training.
    training : int

    Returns
    -------
    ndarray, shape (sequences,)
        Signed statistic of the most likely step; an alarm exceeds a threshold of `find_threshold`.
    ndarray of int, shape (sequences,)
        The record at which that step begins.
    """
    limited = limit_values(values, errors, training)
    steps = test_steps(limited, training, estimate_autocorrelation(limited, training))
    best = np.argmax(np.abs(steps), axis=0)
    found: Signal = np.take_along_axis(steps, best[None], axis=0)[0]
    return found, len(values) - MIN_CHANGED + 1 - len(steps) + best


def _average(values: Signal, is_used: NDArray[np.bool_]) -> Signal:
    average: Signal = np.sum(values * is_used, axis=0) / np.maximum(np.count_nonzero(is_used, axis=0), 1)
    return average


def _remove_line(values: Signal, is_used: NDArray[np.bool_]) -> Signal:
    """Remove a straight line from the used part of each sequence."""
    order = np.arange(len(values), dtype=np.float64)[:, None]
    place = (order - _average(order, is_used)) * is_used
    centred = values - _average(values, is_used) * is_used
    # Two values would be their own line.
    size = np.where(np.count_nonzero(is_used, axis=0) > 2, np.sum(place**2, axis=0), np.inf)
    slope = np.sum(place * centred, axis=0) / np.maximum(size, 1.0)
    return centred - slope * place
