"""Shape of a column: whether it looks like a command or like a measured response."""

from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

#: Levels of a command, at most, and multiple of a jump relative to the range from which on it is large.
_MOST_LEVELS, _LARGE = 12, 5.0

#: Orders of the differences that bound the noise, and the median of the square of normal noise.
_ORDERS, _MEDIAN_SQUARE = (4, 6, 8), 0.455

#: Decimal logarithm of the noise, and increments, relative to the standard deviation, that count as none.
NO_NOISE, _NO_INCREMENT = -4.0, 1e-5

#: Lags of a cross-correlation, at most.
_MOST_LAGS = 200

#: Error of a column as a sum of a few samples of another one, relative to its increments, and sum of the
#: weights relative to their size, up to which it is a derivative.
_DERIVED, _BALANCED = 0.05, 0.01

#: Correlation of the increments of a total with a column of which it adds one sign, at least, and part of the
#: samples with each sign, at least.
_TOTAL, _EACH_SIGN = 0.95, 0.05

#: Levels of a label, and increments of the column that it groups that are jumps: at least, relative to the
#: median and to the range.
_MOST_LABELS, _JUMP, _NO_JUMP = 12, 10.0, 1e-3

#: Part of the changes of a label in which the other column jumps, at least; jumps between them, at least, and
#: their median relative to that of the former.
_LABEL_CHANGES, _LEAST_BETWEEN, _LEAST_RATIO = 0.9, 5, 0.25

#: Error of a column as the product of two others, relative to its standard deviation, and to the error of a
#: sum of them, up to which it is computed from them.
_PRODUCT, _PRODUCT_GAIN = 0.01, 0.3

#: Error of the increments of a column as a sum of others, relative to their size, up to which it is computed.
_COMPUTED = 1e-3

#: Lags of the other columns that a controller or a logger may compute a column from.
_COMPUTED_LAGS = 3

#: Standard errors from which on a controller responds to a column; and changes of a set point, and the
#: correlation of the output of the controller with them, at least.
_SIGNIFICANT, _CHANGES, _AT_ONCE = 5.0, 5, 0.8

#: Part of its increments that a part of the record must have to show whether the column is computed.
_MOVING = 0.1


def measure_command(x: NDArray[np.float64]) -> float:
    """Return how much a column looks like a command, between 0 and 1.

    A command jumps between a few levels, or is held between large jumps. A coarse sensor is held too, but its
    jumps are small.
    """
    steps = np.diff(x)
    jumps = np.abs(steps[steps != 0.0])
    if jumps.size == 0:
        return 0.0
    large = min(1.0, _LARGE * float(np.median(jumps)) / float(np.ptp(x)))
    held = 1.0 - jumps.size / steps.size
    return large if np.unique(x).size <= _MOST_LEVELS else large * held


def measure_noise_level(x: NDArray[np.float64]) -> float:
    """Return the decimal logarithm of the noise of a column relative to its standard deviation."""
    bounds = []
    for order in _ORDERS:
        median = float(np.median(np.diff(x, order) ** 2))
        bounds.append(np.sqrt(median / _MEDIAN_SQUARE / comb(2 * order, order)))
    return max(float(np.log10(min(bounds) / x.std() + 1e-300)), NO_NOISE)


def measure_roughness(x: NDArray[np.float64]) -> float:
    """Return the decimal logarithm of the increments of a column relative to its standard deviation."""
    return float(np.log10(np.diff(x).std() / x.std() + _NO_INCREMENT)) if np.ptp(x) > 0.0 else 0.0


def measure_precedence(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Return whether the increments of y follow those of x (to 1) or precede them (to -1).

    The squared cross-correlation at positive lags is compared with that at negative ones.
    """
    one, other = (np.diff(each) - np.diff(each).mean() for each in (x, y))
    size = one.size
    spectrum = np.conj(np.fft.rfft(one, 2 * size)) * np.fft.rfft(other, 2 * size)
    power = np.fft.irfft(spectrum) ** 2
    lags = min(size // 4, _MOST_LAGS)
    after, before = float(power[1 : lags + 1].sum()), float(power[-lags:].sum())
    return (after - before) / max(after + before + float(power[0]), np.finfo(np.float64).tiny)


def is_derived(x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether x is a derivative of y: a sum of a few samples of y with weights that balance."""
    centred = (y - y.mean()) / y.std()
    shifted = (centred[3:], centred[2:-1], centred[1:-2], centred[:-3])
    matrix, target = np.column_stack((*shifted, np.ones(len(y) - 3))), x[2:-1]
    weights = np.linalg.lstsq(matrix, target, rcond=1e-13)[0]
    size = float(np.median(np.abs(target - np.median(target)))) or float(target.std())
    error = float(np.median(np.abs(target - matrix @ weights)))
    balance = abs(float(weights[:-1].sum())) <= _BALANCED * float(np.abs(weights[:-1]).sum())
    return bool(error <= _DERIVED * size and balance)


def is_total(x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether x adds up the values of y of one sign, as a counter of the charge that flows in.

    The other sign does not change x; a column that begins again once, in another step of a test, is a total,
    too.
    """
    steps = np.diff(x)
    for part in (y, -y):
        added = np.maximum(part, 0.0)
        if not _EACH_SIGN <= np.mean(added > 0.0) <= 1.0 - _EACH_SIGN:
            continue
        rising = steps[steps >= 0.0]
        if rising.size < 0.99 * steps.size or np.ptp(rising) == 0.0:
            continue
        # The sample of y at either end of the step may be the one that is added.
        for values in (added[:-1], added[1:]):
            kept = values[steps >= 0.0]
            if np.ptp(kept) > 0.0 and np.corrcoef(rising, kept)[0, 1] >= _TOTAL:
                return True
    return False


def describe_copy(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    """Return whether x is a copy of y, or a scaled one, such as the same signal in another unit."""
    if np.array_equal(x, y):
        return "a copy"
    centred, other = x - x.mean(), y - y.mean()
    scale = float(np.dot(centred, other) / max(float(np.dot(other, other)), np.finfo(np.float64).tiny))
    error = float(np.sqrt(np.mean((centred - scale * other) ** 2)))
    return "a scaled copy" if error <= _COMPUTED * float(centred.std()) and error < np.inf else ""


def is_product(x: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether x is a multiple of the product of two columns, as a power that a logger computes.

    A product with a column that hardly varies is a multiple of the other one, and shows nothing.
    """
    product = one * other
    scale = float(np.dot(x, product) / max(float(np.dot(product, product)), np.finfo(np.float64).tiny))
    error = float(np.sqrt(np.mean((x - scale * product) ** 2)))
    if not error <= _PRODUCT * float(x.std()):
        return False
    linear = np.column_stack((one, other, np.ones(x.size)))
    rest = x - linear @ np.linalg.lstsq(linear, x, rcond=None)[0]
    return error <= _PRODUCT_GAIN * float(rest.std())


def is_label(x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether x numbers groups of the values of y, as the step of a battery cycler or a sign.

    The ranges of y at the values of x do not overlap, and y also jumps while x stays: x is a part of it.
    The command of a relay is none, since its measured response does not jump by itself.
    """
    levels = np.unique(x)
    if not 1 < levels.size <= _MOST_LABELS or np.any(levels != np.round(levels)):
        return False
    ranges = sorted((float(y[x == level].min()), float(y[x == level].max())) for level in levels)
    if any(above[0] <= below[1] for below, above in pairwise(ranges)):
        return False
    steps, changed = np.abs(np.diff(y)), np.diff(x) != 0.0
    least = max(_JUMP * float(np.median(steps)), _NO_JUMP * float(np.ptp(y)))
    at_changes, between = steps[changed], steps[~changed]
    between = between[between > least]
    if np.mean(at_changes > least) < _LABEL_CHANGES or between.size < _LEAST_BETWEEN:
        return False
    return bool(np.median(between) >= _LEAST_RATIO * np.median(at_changes))


def is_feedback(
    x: NDArray[np.float64], set_point: NDArray[np.float64], measured: NDArray[np.float64]
) -> bool:
    """Return whether a column follows the increments of two others at once, with opposite signs.

    A controller that acts on the difference of set point and measurement does; a response is later.
    """
    changes = np.diff(set_point)
    at = np.flatnonzero(changes)
    if at.size < _CHANGES or np.ptp(changes[at]) == 0.0 or np.ptp(np.diff(x)[at]) == 0.0:
        return False
    if abs(float(np.corrcoef(changes[at], np.diff(x)[at])[0, 1])) < _AT_ONCE:
        return False
    steps = np.column_stack([np.diff(set_point), np.diff(measured)])
    steps /= np.maximum(steps.std(axis=0), np.finfo(np.float64).tiny)
    target = np.diff(x)
    weights = np.linalg.lstsq(steps, target, rcond=None)[0]
    error = float(np.std(target - steps @ weights)) / np.sqrt(target.size)
    return bool(np.abs(weights).min() > _SIGNIFICANT * error and weights[0] * weights[1] < 0.0)


def find_computed(signals: NDArray[np.float64]) -> tuple[int, ...]:
    """Return the columns that the others determine exactly, as those of a control loop with its error.

    A controller that is at its limits for a part of the time is found in the other parts.

    Parameters
    ----------
    signals : ndarray, shape (columns, samples)
        Columns that are not constant.
    """
    scaled = (signals - signals.mean(axis=1, keepdims=True)) / signals.std(axis=1, keepdims=True)
    samples = signals.shape[1] - _COMPUTED_LAGS
    lagged = [
        [x[_COMPUTED_LAGS - lag : _COMPUTED_LAGS - lag + samples] for lag in range(_COMPUTED_LAGS + 1)]
        for x in scaled
    ]
    return tuple(place for place in range(len(signals)) if _is_computed(lagged, place))


def _is_computed(lagged: list[list[NDArray[np.float64]]], place: int) -> bool:
    target = lagged[place][0] - lagged[place][1]
    columns = [
        x for other, parts in enumerate(lagged) for lag, x in enumerate(parts) if lag > 0 or other != place
    ]
    matrix = np.column_stack((*columns, np.ones(target.size)))
    length = min(target.size, 4 * matrix.shape[1])
    for first in range(0, target.size - length + 1, length):
        part = slice(first, first + length)
        size = float(target[part].std())
        if size <= _MOVING * float(target.std()):
            continue
        weights = np.linalg.lstsq(matrix[part], target[part], rcond=1e-13)[0]
        if float(np.std(target[part] - matrix[part] @ weights)) <= _COMPUTED * size:
            return True
    return False
