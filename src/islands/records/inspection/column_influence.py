"""Influence of columns on each other: the part of a prediction error that another column removes.

Linear regressions predict the increment of a column from its past, and from the past and the present of
others (Granger, Econometrica 37, 1969). Means of several samples show the influence in slow processes and
behind long dead times. Each block of the record is predicted with the weights of the other blocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Samples of a mean at each scale, and means of a scale, at least and at most.
_SCALES, LEAST_SAMPLES, _MOST_MEANS = (1, 4, 16), 80, 4000

#: Samples that are used, at most.
MOST_SAMPLES = _SCALES[-1] * _MOST_MEANS

#: Lags of a column, lags of its square from the present on, and blocks that are predicted in turn.
_LAGS, _SQUARES, _BLOCKS = 8, 3, 8

#: Regressors of a column.
_REGRESSORS = _LAGS + 1 + _SQUARES

#: Means for each regressor of a modulation, at least.
_ROWS_PER_COLUMN = 10

#: Assumed accuracy of a regressor, relative to its root mean square.
_ACCURACY = 1e-5

#: Part of the movement of a column that is in one block, if it moves once; and standard deviations of the
#: distribution of twice the gain of noise by which the gain of such a column exceeds it.
_ONE_BLOCK, _DEVIATIONS = 0.9, 6.0

#: Gain that counts, at least: in blocks that are predicted, and in the errors of a fit.
_LEAST_GAIN, _LEAST_FIT = 0.01, 0.05


@dataclass(frozen=True, slots=True, eq=False)
class _Regressions:
    """Products of the regressors of all columns, shape (blocks, regressors, regressors).

    The regressors of a column are its last value and increments (the past), and its present increment and
    squares (the present). The present increments are the targets. The last regressor is one.
    """

    products: NDArray[np.float64]

    @staticmethod
    def past(column: int) -> list[int]:
        first = column * _REGRESSORS
        return list(range(first, first + _LAGS))

    @staticmethod
    def whole(column: int) -> list[int]:
        first = column * _REGRESSORS
        return list(range(first, first + _REGRESSORS))

    def measure_errors(self, target: int, regressors: Sequence[int]) -> NDArray[np.float64]:
        """Return the squared errors of a regressor, predicted by others, shape (blocks,)."""
        others = self.products.sum(axis=0) - self.products
        return _measure_errors(others, self.products, target, regressors)

    def measure_gain(self, target: int, known: Sequence[int], added: Sequence[int]) -> float:
        """Return half the logarithm of the ratio of errors of the increments of a column."""
        increment = self.past(target)[-1] + 1
        if self._moves_once(added[0]):
            return self._measure_fit(increment, known, added)
        before = self.measure_errors(increment, known)
        return _rate(before, self.measure_errors(increment, [*known, *added]))

    def _moves_once(self, regressor: int) -> bool:
        """Return whether the column of a regressor moves in one block only, as the input of a step test."""
        increment = self.past(regressor // _REGRESSORS)[-1] + 1
        power = self.products[:, increment, increment]
        return float(power.max()) > _ONE_BLOCK * float(power.sum())

    def _measure_fit(self, target: int, known: Sequence[int], added: Sequence[int]) -> float:
        """Return the gain in the errors of all samples, zero if that of noise may be as large.

        No other block shows the response to a single movement. Twice the gain of noise in all samples is
        distributed as chi-squared.
        """
        products = self.products.sum(axis=0, keepdims=True)
        before, after = (
            float(_measure_errors(products, products, target, chosen)[0])
            for chosen in (known, [*known, *added])
        )
        gain, samples = 0.5 * float(np.log(before / after)), float(products[0, -1, -1])
        least = len(added) + _DEVIATIONS * np.sqrt(2.0 * len(added))
        return gain if 2.0 * samples * gain >= least and gain >= _LEAST_FIT else 0.0


def _measure_errors(
    fitted: NDArray[np.float64], predicted: NDArray[np.float64], target: int, regressors: Sequence[int]
) -> NDArray[np.float64]:
    """Return the errors in the products ``predicted`` of the weights that fit those in ``fitted``."""
    chosen = [*regressors, len(fitted[0]) - 1]
    matrix, right = fitted[:, chosen][:, :, chosen], fitted[:, chosen, target]
    inner, outer = predicted[:, chosen][:, :, chosen], predicted[:, chosen, target]
    ridge = _ACCURACY**2 * np.einsum("bii->bi", matrix) + np.finfo(np.float64).tiny
    regular = matrix + ridge[:, :, None] * np.eye(len(chosen))
    weights = np.linalg.solve(regular, right[:, :, None])[:, :, 0]
    power = predicted[:, target, target]
    errors = power - 2 * np.einsum("bi,bi->b", weights, outer)
    errors += np.einsum("bi,bij,bj->b", weights, inner, weights)
    found: NDArray[np.float64] = np.maximum(errors, _ACCURACY**2 * power) + np.finfo(np.float64).tiny
    return found


def _rate(before: NDArray[np.float64], after: NDArray[np.float64]) -> float:
    """Return the gain of all blocks, zero if it is small or is that of one block only."""
    gain = 0.5 * float(np.log(before.sum() / after.sum()))
    without_one = 0.5 * np.log((before.sum() - before) / (after.sum() - after))
    return gain if min(gain, float(without_one.min())) >= _LEAST_GAIN else 0.0


def _make_regressions(signals: NDArray[np.float64]) -> _Regressions:
    sizes = signals.std(axis=1, keepdims=True)
    signals = (signals - signals.mean(axis=1, keepdims=True)) / np.where(sizes > 0.0, sizes, 1.0)
    rows = np.arange(_LAGS, signals.shape[1])
    regressors = []
    for x in signals:
        increments, squares = np.diff(x, prepend=x[0]), x**2 - 1.0
        regressors += [x[rows - 1], *(increments[rows - lag] for lag in range(1, _LAGS)), increments[rows]]
        regressors += [squares[rows - lag] for lag in range(_SQUARES)]
    matrix = np.array([*regressors, np.ones(rows.size)])
    scale = np.sqrt(np.mean(matrix**2, axis=1, keepdims=True))
    matrix /= np.where(scale > 0.0, scale, 1.0)
    block = np.arange(rows.size) * (4 * _BLOCKS) // rows.size % _BLOCKS
    parts = (matrix[:, block == each] for each in range(_BLOCKS))
    return _Regressions(np.array([np.einsum("ir,jr->ij", part, part) for part in parts]))


@dataclass(frozen=True, slots=True, eq=False)
class ColumnInfluence:
    """Influence of the columns of a record on each other.

    Row: the column that predicts. Column: the one that is predicted. A gain is half the logarithm of the
    ratio of the squared errors without and with the other column, at the scale where it is largest.

    Attributes
    ----------
    leading : ndarray, shape (columns, columns)
        Gain by the past of the other column.
    visible : ndarray, shape (columns, columns)
        Gain by its past and its present.
    direct : ndarray, shape (columns, columns)
        Gain by its past and its present if the column that is most visible besides is known; zero if it is
        not visible.
    """

    leading: NDArray[np.float64]
    visible: NDArray[np.float64]
    direct: NDArray[np.float64]
    signals: tuple[NDArray[np.float64], ...]
    scales: tuple[_Regressions, ...]

    def measure_gain(self, target: int, known: Sequence[int], added: Sequence[int]) -> float:
        """Return what columns add to the prediction of another one by its past and by known columns."""
        gains = []
        for scale in self.scales:
            base = scale.past(target) + [place for each in known for place in scale.whole(each)]
            more = [place for each in added for place in scale.whole(each)]
            gains.append(scale.measure_gain(target, base, more))
        return max(gains, default=0.0)

    def measure_modulation(self, target: int, known: Sequence[int], source: int) -> float:
        """Return what a column, and its products with known columns, add to the prediction of another one."""
        gains = []
        for means in self.signals:
            centred = means - means.mean(axis=1, keepdims=True)
            products = [centred[each] * centred[source] for each in known]
            part = _make_regressions(
                np.array([*(means[each] for each in (target, *known, source)), *products])
            )
            if means.shape[1] < _ROWS_PER_COLUMN * len(part.products[0]):
                break
            places = range(1 + len(known), 2 + 2 * len(known))
            base = part.past(0) + [place for each in range(1, places.start) for place in part.whole(each)]
            gains.append(part.measure_gain(0, base, [place for each in places for place in part.whole(each)]))
        return max(gains, default=0.0)


def measure_influence(signals: NDArray[np.float64]) -> ColumnInfluence:
    """Measure the influence of the columns of a record on each other.

    Parameters
    ----------
    signals : ndarray, shape (columns, samples)
        The columns. All gains are zero for fewer than `LEAST_SAMPLES` samples.
    """
    count = len(signals)
    leading, visible, direct = np.zeros((3, count, count))
    parts = [average_middle(signals, scale) for scale in _SCALES]
    parts = [part for part in parts if part.shape[1] >= LEAST_SAMPLES]
    scales = [_make_regressions(part) for part in parts]
    pairs = [(source, target) for source in range(count) for target in range(count) if source != target]
    for scale in scales:
        for source, target in pairs:
            own = scale.past(target)
            by_past = scale.measure_gain(target, own, scale.past(source))
            by_all = scale.measure_gain(target, own, scale.whole(source))
            leading[source, target] = max(leading[source, target], by_past)
            visible[source, target] = max(visible[source, target], by_past, by_all)
    found = ColumnInfluence(leading, visible, direct, tuple(parts), tuple(scales))
    for source, target in pairs:
        others = [place for place in range(count) if place not in (source, target)]
        best = max(others, key=lambda place: visible[place, target], default=None)
        known = () if best is None or visible[best, target] == 0.0 else (best,)
        if visible[source, target] > 0.0:
            direct[source, target] = found.measure_gain(target, known, (source,))
    return found


def average_middle(values: NDArray[np.float64], scale: int) -> NDArray[np.float64]:
    """Return means of ``scale`` samples from the middle of columns, shape (columns, means)."""
    samples = min(values.shape[1], _MOST_MEANS * scale) // scale * scale
    first = (values.shape[1] - samples) // 2
    means: NDArray[np.float64] = (
        values[:, first : first + samples].reshape(len(values), samples // scale, scale).mean(axis=2)
    )
    return means
