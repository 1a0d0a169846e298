"""Whether the inputs follow the output, as in a closed loop.

Two findings show it. The output is bounded although the process is unstable: an autoregressive model with
inputs (ARX), which is consistent in a closed loop whose controller or process has a delay of a sample, has a
pole outside the unit circle (Ljung, System Identification, 2nd ed., 1999, chapter 13). Or the noise of the
output, which is independent of the inputs in an open loop, predicts later inputs (Granger, Econometrica 37
(1969) 424-438).
"""

from math import log

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.inspection.fact import Fact
from islands.rounding import ROUNDING

#: Lags of the models, and the fewest of them; samples for each of their parameters; and samples, at most.
_LAGS, _FEWEST_LAGS, _SAMPLES_PER_PARAMETER, _MOST_SAMPLES = 16, 2, 4, 8000

#: Standard errors by which the magnitude of an unstable pole exceeds 1.
_STANDARD_ERRORS = 5.0

#: Samples of the noise that predict an input, and the value of chi-square with as many degrees of freedom
#: that chance exceeds once in a million.
_NOISE_LAGS, _CHANCE = 5, 35.9

#: Error with which its own past predicts an input, relative to its standard deviation, below which the input
#: is planned: what is left of it would be predicted by what the model of the output lacks.
_PLANNED = 1e-3

#: Size of a combination of columns, relative to the largest one, that is rounding.
_RANK = 1e-12

_Signal = NDArray[np.float64]


def find_feedback(record: Dataset) -> Fact:
    """Return whether the inputs follow the output.

    Returns
    -------
    Fact
        A yes or no: no if neither of the findings is visible, as of a weak feedback. None if the record is
        too short.
    """
    name = record.output_name
    first = max(0, record.samples - _MOST_SAMPLES) // 2
    part = record[first : first + _MOST_SAMPLES]
    inputs = [place for place in range(part.inputs) if np.ptp(part.u[:, place]) > 0.0]
    known = np.isfinite(part.y).all() and np.ptp(part.y) > 0.0
    lags = min(_LAGS, part.samples // (_SAMPLES_PER_PARAMETER * (1 + len(inputs))))
    rows = [np.arange(begin + lags, end) for begin, end in part.bounds if end - begin > lags]
    if not known or not inputs or lags < _FEWEST_LAGS or not rows:
        return Fact("feedback", name, "feedback_unknown")
    signals = [_standardise(each) for each in (part.y, *part.u[:, inputs].T)]
    at = np.concatenate(rows)
    pole, error, noise = _fit_output(signals, at, lags)
    samples = max(map(len, rows))
    # Without feedback, the noise of the first samples would have grown beyond the range.
    grows = pole > 1.0 and samples * log(pole) > log(max(np.ptp(signals[0]), 1.0) / max(noise, ROUNDING))
    if grows and pole - 1.0 > _STANDARD_ERRORS * error:
        details = {"inputs": record.input_names, "pole": pole, "seconds": record.dt / log(pole)}
        return Fact("feedback", name, "feedback_unstable", True, details=details)
    names = tuple(
        record.input_names[place]
        for number, place in enumerate(inputs, start=1)
        if _follows_noise(signals, number, rows, lags)
    )
    if names:
        return Fact("feedback", name, "feedback_visible", True, details={"inputs": names})
    return Fact("feedback", name, "feedback_none", False)


def _standardise(signal: _Signal) -> _Signal:
    centred = signal - signal.mean()
    return np.asarray(centred / np.ptp(centred), dtype=np.float64)


def _take_lags(signal: _Signal, rows: NDArray[np.int64], first: int, last: int) -> list[_Signal]:
    return [signal[rows - lag] for lag in range(first, last + 1)]


def _fit_output(signals: list[_Signal], rows: NDArray[np.int64], lags: int) -> tuple[float, float, float]:
    """Return the largest magnitude of a pole, its standard error, and the error of the prediction."""
    columns = [column for signal in signals for column in _take_lags(signal, rows, 1, lags)]
    weights, residual, factor = _regress([*columns, np.ones(rows.size)], signals[0][rows])
    noise = float(np.sqrt(residual @ residual / max(1, rows.size - weights.size)))
    polynomial = np.concatenate([[1.0], -weights[:lags]])
    poles = np.roots(polynomial)
    if not poles.size:
        return 0.0, 0.0, noise
    pole = poles[np.argmax(np.abs(poles))]
    # Derivative of the magnitude of the pole with respect to the weights.
    slope = np.polyval(np.polyder(polynomial), pole) * abs(pole)
    turned = np.real(pole ** np.arange(lags - 1, -1, -1) * np.conj(pole) / (slope or 1.0))
    return float(abs(pole)), noise * float(np.linalg.norm(turned @ factor[:lags])), noise


def _follows_noise(signals: list[_Signal], place: int, rows: list[NDArray[np.int64]], lags: int) -> bool:
    """Return whether the noise of the output, signal 0, predicts a later input beyond its own past."""
    at = np.concatenate(rows)
    present = [column for each in signals[1:] for column in _take_lags(each, at, 0, lags)]
    past = _take_lags(signals[0], at, 1, lags)
    noise = np.zeros(len(signals[0]))
    noise[at] = _regress([*past, *present, np.ones(at.size)], signals[0][at])[1]
    later = np.concatenate([each[_NOISE_LAGS:] for each in rows])
    own, target = [*_take_lags(signals[place], later, 1, lags), np.ones(later.size)], signals[place][later]
    alone = _regress(own, target)[1]
    both = _regress([*own, *_take_lags(noise, later, 1, _NOISE_LAGS)], target)[1]
    left, freedom = float(both @ both), later.size - len(own) - _NOISE_LAGS
    least = _PLANNED**2 * target.size * float(np.var(signals[place]))
    return left > least and freedom * (float(alone @ alone) - left) > _CHANCE * left


def _regress(columns: list[_Signal], target: _Signal) -> tuple[_Signal, _Signal, _Signal]:
    """Return the weights of least squares, the residual, and a factor of the covariance of the weights."""
    matrix = np.column_stack(columns)
    triangle = np.asarray(np.linalg.qr(np.column_stack([matrix, target]), mode="r"), dtype=np.float64)
    upper = triangle[: matrix.shape[1]]
    left, sizes, right = np.linalg.svd(upper[:, :-1])
    kept = sizes > _RANK * sizes[0]
    factor = right[kept].T / sizes[kept]
    weights = factor @ (left[:, kept].T @ upper[:, -1])
    return weights, target - matrix @ weights, factor
