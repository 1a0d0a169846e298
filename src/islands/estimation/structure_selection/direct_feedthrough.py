"""Test of direct feedthrough: whether the output of a record responds to an input within the sample.

Two linear regressions predict the increment of the output: one from the past of all signals, one also from
the present increment of an input and its products. If the input is random and the system has a delay, its
present value says nothing about the output that the past does not say, whatever the form of the system. The
regressions are compared on parts of the record that did not estimate them. A ridge penalty, the accuracy
that is assumed of the signals, excludes differences in rounding errors.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset

#: Part of the mean squared prediction error that the present input has to remove: in all, and in every fold.
LEAST_GAIN, LEAST_GAIN_OF_FOLD = 0.25, 0.05

#: Rows of the regressions, at most, and folds that are predicted in turn.
_ROWS, _FOLDS = 8000, 4

#: Rows that a fold needs for every column of a regression.
_ROWS_PER_COLUMN = 2

#: Lags of the output's increments, of those of the tested input, and of those of other inputs.
_OUTPUT_LAGS, _INPUT_LAGS, _OTHER_LAGS = 10, 20, 5

#: Largest lag that a regression reads.
_LARGEST_LAG = _INPUT_LAGS + 2

#: Assumed accuracy of a column of the regressions, relative to its root mean square.
_ACCURACY = 3e-5

#: Prediction error, relative to the increments of the output, below which the past predicts it completely.
_COMPLETE = 1e-5

#: Prediction error of an input's increment, relative to it, below which its present value is no information.
_PREDICTABLE = 2e-6

_Columns = list[NDArray[np.float64]]


def find_direct_inputs(record: Dataset) -> tuple[int, ...]:
    """Return the indices of the inputs to which the output responds within the sample, from 0.

    The input with the largest gain is found first, then that with the largest gain together with those found
    before: an input is not taken for another one that is correlated with it, and its response may depend on
    the others.

    Parameters
    ----------
    record : Dataset
        Estimation data without missing values.
    """
    rows = _choose_rows(record)
    if rows.size == 0 or not np.ptp(record.y) > 0.0:
        return ()
    signals = [_standardise(signal) for signal in (record.y, *record.u.T)]
    varying = [place for place in range(record.inputs) if np.ptp(record.u[:, place]) > 0.0]
    found: list[int] = []
    while others := [place for place in varying if place not in found]:
        gains = {place: _compute_gain(signals, rows, place, found) for place in others}
        best = max(others, key=lambda place: gains[place])
        if not gains[best] > 0.0:
            break
        found.append(best)
    return tuple(sorted(found))


def find_linear_paths(record: Dataset) -> tuple[int, ...]:
    """Return the inputs whose present value removes a quarter of the squared error of a linear prediction.

    The inputs may move in one part of the record alone, as in an impact test, so that no other part shows the
    response again: that an input acts at once is then to be confirmed by models with and without it.

    Parameters
    ----------
    record : Dataset
        Estimation data without missing values.
    """
    rows = _choose_rows(record)
    varying = [place for place in range(record.inputs) if np.ptp(record.u[:, place]) > 0.0]
    if not varying or not np.ptp(record.y) > 0.0:
        return ()
    signals = [_standardise(signal) for signal in (record.y, *record.u[:, varying].T)]
    past = [np.ones(rows.size)]
    past += [signal[rows - lag] for signal in signals for lag in range(1, _OUTPUT_LAGS + 1)]
    if rows.size < _ROWS_PER_COLUMN * _FOLDS * len(past):
        return ()
    without = _measure_error(past, signals[0][rows])
    if without <= _COMPLETE**2 * np.mean(np.diff(signals[0]) ** 2):
        return ()
    # Together with the other inputs, which may be correlated with it.
    present = [signal[rows] for signal in signals[1:]]
    whole = _measure_error([*past, *present], signals[0][rows])
    others = [present[:at] + present[at + 1 :] for at in range(len(present))]
    return tuple(
        place
        for place, rest in zip(varying, others, strict=True)
        if _measure_error([*past, *rest], signals[0][rows]) - whole >= LEAST_GAIN * without
    )


def _measure_error(columns: _Columns, target: NDArray[np.float64]) -> float:
    matrix = np.column_stack(columns)
    weights = np.linalg.lstsq(matrix, target, rcond=_ACCURACY**2)[0]
    return float(np.mean((target - matrix @ weights) ** 2))


def _choose_rows(record: Dataset) -> NDArray[np.int64]:
    """Return the predicted samples, at equal distances over all recordings."""
    usable = np.concatenate([np.arange(begin + _LARGEST_LAG, end) for begin, end in record.bounds])
    if usable.size <= _ROWS:
        return usable
    return usable[np.arange(_ROWS) * usable.size // _ROWS]


def _standardise(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    centred = signal - signal[0]
    centred = centred - np.mean(centred)
    size = float(np.std(centred))
    scaled: NDArray[np.float64] = centred / (size if size > 0.0 else 1.0)
    return scaled


def _compute_gain(
    signals: Sequence[NDArray[np.float64]], rows: NDArray[np.int64], place: int, given: Sequence[int]
) -> float:
    """Return the part of the squared error that the present of an input removes; 0 if it is not enough."""
    y, tested = signals[0], signals[1 + place]
    past = [np.ones(rows.size), *(y[rows - 1] ** power for power in (1, 2, 3))]
    past += _lag_increments(y, rows, _OUTPUT_LAGS)
    past += [tested[rows - 1] ** power for power in (1, 2, 3)] + [tested[rows - 1] * y[rows - 1]]
    past += _lag_increments(tested, rows, _INPUT_LAGS)
    for lag in (1, 2):
        past += _multiply_increment(tested, rows - lag, y[rows - lag])[1:]
    for other, signal in enumerate(signals[1:]):
        if other != place:
            past += [signal[rows - 1], *_lag_increments(signal, rows, _OTHER_LAGS)]
        if other in given:
            past += [*_multiply_increment(signal, rows, y[rows - 1]), tested[rows - 1] * signal[rows]]
    present = _multiply_increment(tested, rows, y[rows - 1])
    present += [(tested[rows] - tested[rows - 1]) * signals[1 + other][rows] for other in given]
    columns = np.array([*past, *present]).T
    if rows.size < _ROWS_PER_COLUMN * _FOLDS * columns.shape[1]:
        return 0.0
    return _compare_predictions(columns, len(past), y[rows] - y[rows - 1])


def _lag_increments(signal: NDArray[np.float64], rows: NDArray[np.int64], lags: int) -> _Columns:
    return [signal[rows - lag] - signal[rows - lag - 1] for lag in range(1, lags + 1)]


def _multiply_increment(
    u: NDArray[np.float64], rows: NDArray[np.int64], output: NDArray[np.float64]
) -> _Columns:
    """Return the increment of an input and its products with the signals before it."""
    increment, before = u[rows] - u[rows - 1], u[rows - 1]
    size = np.abs(increment)
    factors = (increment * before, increment * output, size, size * before, size * output)
    return [increment, *factors, increment * increment]


def _compare_predictions(columns: NDArray[np.float64], past: int, target: NDArray[np.float64]) -> float:
    scale = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    innovation = _predict_folds(columns[:, :past], columns[:, past])
    without, present = (_predict_folds(columns[:, :size], target) for size in (past, columns.shape[1]))
    # The columns have a root mean square of 1.
    if np.mean(innovation) <= _PREDICTABLE**2 or np.mean(without) <= _COMPLETE**2 * np.mean(target**2):
        return 0.0
    gain = float(1.0 - present.sum() / without.sum())
    clear = gain >= LEAST_GAIN and bool(np.all(present <= (1.0 - LEAST_GAIN_OF_FOLD) * without))
    return gain if clear else 0.0


def _predict_folds(columns: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean squared error of every fold, predicted by a ridge regression of the others."""
    fold = np.arange(target.size) * 2 * _FOLDS // target.size % _FOLDS
    parts = [(columns[fold == each], target[fold == each]) for each in range(_FOLDS)]
    # Unlike a matrix product, the sums of einsum do not depend on the number of threads.
    grams = np.array([np.einsum("ri,rj->ij", x, x) for x, _ in parts])
    products = np.array([np.einsum("ri,r->i", x, y) for x, y in parts])
    errors = np.empty(_FOLDS)
    for each, (x, y) in enumerate(parts):
        others = np.arange(_FOLDS) != each
        penalty = (target.size - y.size) * _ACCURACY**2 * np.eye(columns.shape[1])
        weights = np.linalg.solve(grams[others].sum(axis=0) + penalty, products[others].sum(axis=0))
        errors[each] = np.mean((y - np.einsum("ri,i->r", x, weights)) ** 2)
    return errors
