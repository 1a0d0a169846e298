"""Comparison of the first lags at which the output may respond to an input.

Linear regressions predict the increment of the output from its past and from the input at all lags from d on
(a long ARX model, which describes coloured noise too). The first lag is the largest d that predicts other
parts of the record as well as d = 0 does. Blocks of the record are resampled for its uncertainty. Noise
hides the first samples of a slow response: the slopes of the impulse response and of the prediction error
tell how many.
"""

from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.inspection.blocks import BLOCKS, RESAMPLES, assign_blocks, resample

#: Largest dead time of one comparison, lags of the output, and lags of the input after the largest dead time.
LARGEST, _OUTPUT_LAGS, _RESPONSE = 60, 10, 12

#: Lags of the other inputs.
_OTHER_LAGS = 5

#: Rows of the regressions, at most; rows for every column, at least; and folds that are predicted in turn.
_ROWS, _ROWS_PER_COLUMN, _FOLDS = 8000, 4, 4

#: Standard errors of a loss, and part of the loss, that count as equal.
_STANDARD_ERRORS, _EQUAL = 2.0, 3e-3

#: Assumed accuracy of a column of the regressions, relative to its root mean square.
_ACCURACY = 3e-5

#: Part of the increments of an input that its past does not predict, at least.
_LEAST_INNOVATION = 0.01

#: Part of the prediction error of the output that the input removes, at least.
_LEAST_GAIN = 0.02

#: Samples of a hidden response: multiple of those that the slope of the response gives, and the most.
_HIDDEN, _MOST_HIDDEN = 1.5, 10.0

#: Samples before a response that the next values of an input may cause, and their size relative to the next.
_PRECURSORS, _PRECURSOR = 2, 0.35

#: Correlation of an input with itself from which on it repeats itself.
_REPEATED = 0.95

#: Fractions between 0 and 1 that are evenly distributed in any number of resamples.
FRACTIONS = np.arange(RESAMPLES) * 0.6180339887498949 % 1.0


@dataclass(frozen=True, slots=True)
class Onset:
    """First lag of the response: the estimate, and the estimates of the resamples, in samples.

    ``innovation`` is the part of the increments of the input that its past does not predict.
    """

    lag: float
    resampled: NDArray[np.float64]
    innovation: float


def _deny_response(record: Dataset, place: int) -> str:
    name, output = record.input_names[place], record.output_name
    return f"No lag of {name} is visible at which {output} begins to respond."


def compare_lags(record: Dataset, place: int, delay: int) -> Onset | str:
    """Compare the first lags from ``delay`` to ``delay + LARGEST``.

    Parameters
    ----------
    record : Dataset
        Rows with a missing output are left out.
    place : int
        Index of the input, from 0.
    delay : int
        Smallest lag in samples.

    Returns
    -------
    Onset or str
        The first lag, or why the record does not tell it.
    """
    u, y = record.u[:, place], record.y
    others = [signal for other, signal in enumerate(record.u.T) if other != place]
    others = [signal for signal in others if np.ptp(signal) > 0.0]
    repeated = _find_repetition(u)
    if repeated is not None and delay + LARGEST > repeated // 2:
        if delay > 0:
            return _deny_response(record, place)
        largest = repeated // 2
    else:
        largest = LARGEST
    while True:
        columns = 1 + _OUTPUT_LAGS + largest + _RESPONSE + _OTHER_LAGS * len(others)
        rows = _choose_rows(record, delay + largest + _RESPONSE + 1)
        if rows.size >= _ROWS_PER_COLUMN * columns:
            break
        if largest == 0:
            return f"The record is too short to tell the dead time of {record.input_names[place]}."
        largest //= 2
    if not (np.ptp(u) > 0.0 and np.nanmax(y) > np.nanmin(y)):
        return _deny_response(record, place)
    u, y = _standardise(u), _standardise(y)
    target = y[rows] - y[rows - 1]
    lagged = [u[rows - delay - lag] for lag in range(largest + _RESPONSE + 1)]
    innovation = _measure_innovation(lagged)
    if innovation < _LEAST_INNOVATION:
        return (
            f"{record.input_names[place]} is predictable from its past, so the dead time is not separable "
            "from the phase of the response."
        )
    past = [np.ones(rows.size), y[rows - 1]]
    past += [y[rows - lag] - y[rows - lag - 1] for lag in range(1, _OUTPUT_LAGS)]
    past += [_standardise(signal)[rows - lag] for signal in others for lag in range(1, 1 + _OTHER_LAGS)]
    # From the largest lag to the smallest, so that the model of first lag d is a leading block.
    response = [
        lagged[-1],
        *(now - before for now, before in zip(lagged[-2::-1], lagged[:0:-1], strict=True)),
    ]
    matrix = np.array([*past, *response])
    scale = np.sqrt(np.mean(matrix**2, axis=1))
    scale[scale == 0.0] = 1.0
    comparison = _Comparison(
        matrix / scale[:, None], target, scale, len(past), largest, delay, innovation, _is_averaged(u)
    )
    return comparison.find_onset() or _deny_response(record, place)


@dataclass(frozen=True, slots=True)
class _Comparison:
    """Columns of the regressions, shape (columns, rows), and the predicted increments, shape (rows,)."""

    columns: NDArray[np.float64]
    target: NDArray[np.float64]
    scale: NDArray[np.float64]
    past: int
    largest: int
    delay: int
    innovation: float
    is_averaged: bool

    def find_onset(self) -> Onset | None:
        """Return the first lag of the response, None if there is none."""
        size = len(self.columns)
        sizes = [*range(size, size - self.largest - 1, -1), self.past]
        losses, weights = self._predict(sizes)
        totals = losses.sum(axis=1)
        best = int(np.argmin(totals[:-1]))
        if totals[-1] - totals[best] <= _LEAST_GAIN * totals[-1]:
            return None
        differences = losses[:-1] - losses[best]
        spread = np.sum((differences - differences.mean(axis=1, keepdims=True)) ** 2, axis=1)
        error = np.sqrt(BLOCKS / (BLOCKS - 1) * spread)
        equal = np.maximum(_STANDARD_ERRORS * error, _EQUAL * totals[best])[:, None]
        first = int(_last_equal(totals[:-1, None], equal)[0])
        resampled = _last_equal(resample(losses[:-1]), equal).astype(np.float64)
        response = _compute_impulse_response(weights[first], self.past, _PRECURSORS + 2)
        precursors = _count_precursors(response) if self.is_averaged else 0
        if precursors > 0:
            return Onset(
                float(self.delay + first + precursors),
                self.delay + resampled + np.round(precursors * FRACTIONS),
                self.innovation,
            )
        hidden = min(self._count_hidden(totals[:-1] - totals[best], equal[:, 0], first, response), first)
        return Onset(
            self.delay + first - floor(0.5 * hidden),
            self.delay + resampled - hidden * FRACTIONS,
            self.innovation,
        )

    def _predict(self, sizes: list[int]) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
        """Return the squared errors of all blocks and the weights, for models of some leading columns."""
        block = assign_blocks(self.target.size)
        fold = block % _FOLDS
        grams, products = [], []
        for each in range(_FOLDS):
            x = self.columns[:, fold == each]
            grams.append(np.einsum("ir,jr->ij", x, x))
            products.append(np.einsum("ir,r->i", x, self.target[fold == each]))
        penalty = _ACCURACY**2 * self.target.size
        losses, weights = np.empty((len(sizes), BLOCKS)), []
        for row, size in enumerate(sizes):
            errors = np.empty(self.target.size)
            ridge = penalty * np.eye(size)
            for each in range(_FOLDS):
                others = [other for other in range(_FOLDS) if other != each]
                gram = np.sum([grams[other][:size, :size] for other in others], axis=0)
                product = np.sum([products[other][:size] for other in others], axis=0)
                fitted = np.linalg.solve(gram + ridge, product)
                held = fold == each
                errors[held] = self.target[held] - np.einsum("ir,i->r", self.columns[:size, held], fitted)
            losses[row] = np.bincount(block, errors**2, BLOCKS)
            whole = np.linalg.solve(
                np.sum(grams, axis=0)[:size, :size] + ridge, np.sum(products, axis=0)[:size]
            )
            weights.append(whole / self.scale[:size])
        return losses, weights

    def _count_hidden(
        self,
        losses: NDArray[np.float64],
        equal: NDArray[np.float64],
        first: int,
        response: NDArray[np.float64],
    ) -> float:
        """Return how many samples before its first visible lag a response may have begun.

        A response that increases linearly begins where its slope crosses zero, and a loss that increases with
        the square of the lag where its root does. A response of which the part v would be visible one sample
        earlier, and that increases with the square of time, begins at most 1 / (1 - sqrt(v)) samples earlier.
        """
        if first + 2 >= len(losses):
            return 0.0
        jump, further = float(losses[first + 1]), float(losses[first + 2])
        visible = min(1.0, (float(equal[first]) / jump) ** 0.5)
        at_most = 1.0 / max(1.0 - visible**0.5, 1.0 / _MOST_HIDDEN)
        size = response * np.sign(response[0])
        slope = max((size[lag] - size[0]) / lag for lag in (1, 2, 3))
        by_slope = _HIDDEN * size[0] / slope if slope > 0.0 else 0.0
        by_loss = 2.0 * jump / (further - jump) - 1.0 if further > jump else _MOST_HIDDEN
        return float(min(max(by_slope, by_loss), at_most))


def _count_precursors(response: NDArray[np.float64]) -> int:
    """Return how many samples of alternating sign, each much larger than the one before, precede a response.

    A mean of a held input over a change contains a part of the next level, which the prediction subtracts at
    a lag before the dead time.
    """
    count = 0
    while (
        count < _PRECURSORS
        and response[count] * response[count + 1] < 0.0
        and abs(response[count]) < _PRECURSOR * abs(response[count + 1])
    ):
        count += 1
    return count


def _compute_impulse_response(weights: NDArray[np.float64], past: int, samples: int) -> NDArray[np.float64]:
    """Return the response to a unit pulse from its first lag on, shape (samples,)."""
    lags, inputs = weights[1 : 1 + _OUTPUT_LAGS], weights[past:][::-1]
    y = np.zeros(_OUTPUT_LAGS + samples)
    for k in range(samples):
        at = _OUTPUT_LAGS + k
        before = y[at - np.arange(1, _OUTPUT_LAGS + 1)]
        increments = before[:-1] - before[1:]
        # The weights belong to the increments of a unit step.
        moved = lags[0] * before[0] + float(np.sum(lags[1:] * increments))
        y[at] = before[0] + moved + inputs[min(k, len(inputs) - 1)]
    return np.diff(y[_OUTPUT_LAGS - 1 :])


def _last_equal(losses: NDArray[np.float64], equal: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the largest first lag whose loss (lags, cases) is equal to the least, without gap."""
    least = np.argmin(losses, axis=0)
    worse = (losses - losses.min(axis=0) > equal) & (np.arange(len(losses))[:, None] > least)
    return np.where(worse.any(axis=0), np.argmax(worse, axis=0) - 1, len(losses) - 1)


def _choose_rows(record: Dataset, lags: int) -> NDArray[np.int64]:
    """Return predicted samples with known outputs, at equal distances over all recordings."""
    usable = [np.arange(min(begin + lags, end), end) for begin, end in record.bounds]
    rows = np.concatenate(usable)
    known = np.isfinite(record.y)
    if not known.all():
        missing = np.concatenate([[0], np.cumsum(~known)])
        rows = rows[missing[rows + 1] == missing[rows - _OUTPUT_LAGS]]
    return rows if rows.size <= _ROWS else rows[np.arange(_ROWS) * rows.size // _ROWS]


def _standardise(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    centred = signal - np.nanmean(signal)
    size = float(np.nanstd(centred))
    scaled: NDArray[np.float64] = centred / (size if size > 0.0 else 1.0)
    return scaled


def _find_repetition(u: NDArray[np.float64]) -> int | None:
    """Return the first lag at which an input is correlated with itself again, in either sign."""
    centred = u - u.mean()
    power = np.abs(np.fft.rfft(centred, 2 * u.size)) ** 2
    correlation = np.fft.irfft(power)[: u.size // 2 + 1]
    pairs = u.size - np.arange(correlation.size)
    relative = np.abs(correlation) * u.size / (pairs * max(correlation[0], np.finfo(np.float64).tiny))
    low = np.flatnonzero(relative < 0.5)
    again = np.flatnonzero(relative[low[0] :] > _REPEATED) if low.size else low
    return int(low[0] + again[0]) if again.size else None


def _is_averaged(u: NDArray[np.float64]) -> bool:
    """Return whether most changes of a held input have a value between the levels before and after.

    So have the means of an input whose changes are between two samples of the record.
    """
    before, now, after = u[1:-3], u[2:-2], u[3:-1]
    is_edge = (u[:-4] == before) & (after == u[4:]) & (before != after)
    between = is_edge & (np.minimum(before, after) < now) & (now < np.maximum(before, after))
    changes = int(np.count_nonzero(np.diff(u)))
    # A change with a value between is two steps.
    return 4 * int(np.count_nonzero(between)) > changes


def _measure_innovation(lagged: list[NDArray[np.float64]]) -> float:
    """Return the part of the increments of an input that its past does not predict, as a ratio of rms."""
    increment = lagged[0] - lagged[1]
    past = np.array([np.ones(increment.size), *lagged[1 : 1 + _RESPONSE]])
    gram = np.einsum("ir,jr->ij", past, past)
    ridge = 1e-14 * increment.size * np.eye(len(past))
    weights = np.linalg.solve(gram + ridge, np.einsum("ir,r->i", past, increment))
    left = increment - np.einsum("ir,i->r", past, weights)
    size = float(np.std(increment))
    return float(np.std(left)) / size if size > 0.0 else 0.0
