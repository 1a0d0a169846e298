"""Gross errors of a measured output: codes of missing values, isolated spikes, and a stuck sensor.

Least squares follows a single value far outside of the range, so gross errors are found before an estimation.
All criteria are strict: an output that is only fast, nonlinear or noisy has no gross errors.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.segments import fill_gaps

Signal = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Numbers with which loggers and instruments mark a missing value or an overflow.
_CODES = frozenset(
    [-99.0, -999.0, -999.25, -9999.0, -99999.0, -999999.0, 999.0, 9999.0, 99999.0, 999999.0]
    + [-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0]
    + [sign * value for value in (1e30, 1e31, 1e37, 9.9e37, 9.91e37, 1e38) for sign in (1.0, -1.0)]
)

#: Least distance of a code, and of another repeated value, from all other values, relative to their range.
_CODE_GAP, _REPEATED_GAP = 2.0, 5.0

#: Largest part of the values that are equal, unless they are a known code.
_MOST_REPEATED = 0.05

#: Distinct values of an output, at least: codes of an output with a few levels are levels.
_LEAST_LEVELS = 10

#: Samples of the median from which a spike deviates, and of the longest spike.
_WINDOW, _LONGEST_SPIKE = 7, 3

#: Deviation of a spike from the median relative to the robust standard deviation, to the 99 % quantile of the
#: deviations, and to the range of the central 98 % of the values, at least.
_DEVIATION, _QUANTILE_RATIO, _RANGE_RATIO = 12.0, 5.0, 0.1

#: Largest part of the samples that are spikes.
_MOST_SPIKES = 0.01

#: Lags of the linear prediction that confirms a spike, and the error of its prediction relative to the robust
#: standard deviation and to the 99 % quantile of the errors, at least.
_LAGS, _ERROR, _ERROR_RATIO = 3, 10.0, 4.0

#: Largest error of the prediction after a spike, which does not use the spike, relative to the spike: the
#: system has not moved.
_AFTER = 0.1

#: Samples before a spike in which a movement of an input may cause it.
_CAUSE = 30

#: Movements of an input, of at least half the size, that no spike follows: then the spike has another cause.
_UNANSWERED = 5

#: Rows that a description lists, at most.
_LISTED = 6

#: Equal successive values of a stuck sensor, at least, and the number of such parts, at most.
_LEAST_STUCK, _MOST_STUCK = 20, 5

#: Motion of an input while a sensor is stuck, relative to its range, at least.
_MOVING = 0.1

#: Other increments that are zero, at most.
_RESTING = 0.01

#: Second differences of a part, the parts where they are least, and the changes of their sign, at least: the
#: output is noisy, and would not be constant at rest.
_PART, _QUIET, _ALTERNATING = 10, 0.2, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class GrossErrors:
    """Samples of an output that do not measure it.

    Attributes
    ----------
    codes : dict of float to ndarray
        Samples by the number that marks a missing value.
    spikes : ndarray
        Samples of isolated spikes.
    stuck : tuple of (int, int)
        First sample of each part in which the sensor is stuck, and the sample after its last.
    """

    codes: dict[float, NDArray[np.int64]]
    spikes: NDArray[np.int64]
    stuck: tuple[tuple[int, int], ...]

    @property
    def samples(self) -> NDArray[np.int64]:
        """All samples in ascending order."""
        stuck = [np.arange(first, last) for first, last in self.stuck]
        return np.unique(np.concatenate([*self.codes.values(), self.spikes, *stuck]))

    def describe(self, row: Callable[[int], str]) -> str:
        """Return what was found where, ``row`` being the text for a sample; empty if nothing was found."""
        found = [
            f"{len(places)} times {code:.12g}, a code of missing values ({_list_rows(places, row)})"
            for code, places in self.codes.items()
        ]
        if self.spikes.size:
            plural = "s" if self.spikes.size > 1 else ""
            found.append(f"{self.spikes.size} isolated spike{plural} ({_list_rows(self.spikes, row)})")
        found += [f"a stuck sensor from {row(first)} to {row(last - 1)}" for first, last in self.stuck]
        return "; ".join(found)


def _list_rows(samples: NDArray[np.int64], row: Callable[[int], str]) -> str:
    listed = ", ".join(row(int(sample)) for sample in samples[:_LISTED])
    return f"{listed} and {samples.size - _LISTED} more" if samples.size > _LISTED else listed


def find_gross_errors(y: Signal, u: Signal) -> GrossErrors:
    """Find the gross errors of an output.

    Parameters
    ----------
    y : ndarray, shape (samples,)
        Output; NaN marks a missing value.
    u : ndarray, shape (samples, inputs)
        Inputs. A spike that follows a rare movement of an input is a response.
    """
    codes: dict[float, NDArray[np.int64]] = {}
    y = np.where(np.isfinite(y), y, np.nan)
    u = np.where(np.isfinite(u), u, np.nan)
    u = np.column_stack([np.zeros(y.size), *(fill_gaps(each) for each in u.T if not np.isnan(each).all())])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        while (code := _find_code(y)) is not None:
            codes[code] = np.flatnonzero(y == code)
            y = np.where(y == code, np.nan, y)
        return GrossErrors(codes, _find_spikes(y, u), _find_stuck(y, u))


def find_input_codes(u: Signal) -> dict[float, NDArray[np.int64]]:
    """Return the samples of an input, shape (samples,), by the code of a missing value."""
    with np.errstate(over="ignore", invalid="ignore"):
        code = _find_code(u, is_measured=False)
    return {} if code is None else {code: np.flatnonzero(u == code)}


def _find_code(y: Signal, is_measured: bool = True) -> float | None:
    """Return an extreme value that is far from all others, and a code, or repeated in a measured signal."""
    known = y[np.isfinite(y)]
    if known.size < _LEAST_LEVELS:
        return None
    for extreme in (float(known.min()), float(known.max())):
        others = known[known != extreme]
        if others.size <= known.size // 2 or np.unique(others).size < _LEAST_LEVELS:
            continue
        gap = float(np.abs(others - extreme).min()) / float(np.ptp(others))
        is_repeated = is_measured and 1 < known.size - others.size <= _MOST_REPEATED * known.size
        if gap > (_CODE_GAP if extreme in _CODES else _REPEATED_GAP if is_repeated else np.inf):
            return extreme
    return None


def _find_spikes(y: Signal, u: Signal) -> NDArray[np.int64]:
    """Return the samples of isolated spikes that neither the inputs nor a motion explain."""
    is_candidate = _find_candidates(y)
    if not is_candidate.any() or is_candidate.mean() > _MOST_SPIKES:
        return np.zeros(0, np.int64)
    places = np.flatnonzero(is_candidate)
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    prediction = _Prediction(y, u, is_candidate)
    confirmed = [
        run
        for run in runs
        if len(run) <= _LONGEST_SPIKE
        and run[0] >= _LAGS
        and prediction.contradicts(run)
        and not _is_response(int(run[0]), u, places)
    ]
    return np.concatenate([np.zeros(0, np.int64), *confirmed])


def _find_candidates(y: Signal) -> Mask:
    """Return the samples that are far from the median of their neighbours."""
    known = np.isfinite(y)
    if np.count_nonzero(known) <= 2 * _WINDOW:
        return np.zeros(y.size, np.bool_)
    filled = np.interp(np.arange(y.size), np.flatnonzero(known), y[known])
    padded = np.pad(filled, _WINDOW // 2, mode="reflect")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, _WINDOW), axis=1)
    deviation = np.abs(filled - medians)
    low, high = np.quantile(y[known], [0.01, 0.99])
    least = max(
        _DEVIATION * 1.4826 * float(np.median(deviation)),
        _QUANTILE_RATIO * float(np.quantile(deviation, 0.99)),
        _RANGE_RATIO * float(high - low),
    )
    return known & (deviation > max(least, 1e-12 * float(np.abs(filled).max())))


class _Prediction:
    """Linear prediction of the output from past outputs and from inputs, fitted without the candidates."""

    def __init__(self, y: Signal, u: Signal, is_candidate: Mask) -> None:
        sound = np.isfinite(y) & ~is_candidate
        centre, scale = float(np.median(y[sound])), float(np.std(y[sound])) or 1.0
        spread = np.std(u, axis=0)
        self._y = (y - centre) / scale
        self._u = (u - np.mean(u, axis=0)) / np.where(spread > 0.0, spread, 1.0)
        targets = np.arange(_LAGS, y.size)
        terms = self._terms(self._y, targets)
        complete = sound[targets] & np.isfinite(terms).all(axis=1)
        for lag in range(1, _LAGS + 1):
            complete &= sound[targets - lag]
        terms, target = terms[complete], self._y[targets][complete]
        self._theta = np.linalg.lstsq(terms, target, rcond=1e-10)[0]
        self._errors = np.abs(target - terms @ self._theta)

    def _terms(self, y: Signal, samples: NDArray[np.int64]) -> Signal:
        past = [y[samples - lag] for lag in range(1, _LAGS + 1)]
        inputs = [column[samples - lag] for column in self._u.T for lag in range(_LAGS + 1)]
        return np.column_stack([np.ones(samples.size), *past, *inputs, *(each**2 for each in inputs)])

    def contradicts(self, run: NDArray[np.int64]) -> bool:
        """Return whether a run of samples is no motion: unpredicted, and without effect on what follows."""
        if not self._errors.size:
            return False
        typical = float(np.quantile(self._errors, 0.99))
        least = max(_ERROR * 1.4826 * float(np.median(self._errors)), _ERROR_RATIO * typical)
        y, errors = self._y.copy(), []
        for sample in range(int(run[0]), min(int(run[-1]) + 3, y.size)):
            predicted = float((self._terms(y, np.array([sample])) @ self._theta)[0])
            errors.append(abs(self._y[sample] - predicted))
            if sample <= run[-1]:
                y[sample] = predicted
        during, after = errors[: len(run)], errors[len(run) :]
        most = max(_AFTER * max(during), _ERROR_RATIO * typical)
        return min(during) > least and not any(each > most for each in after)


def _is_response(sample: int, u: Signal, candidates: NDArray[np.int64]) -> bool:
    """Return whether a candidate follows a movement of an input that is rare or that others follow, too."""
    for column in u.T:
        moved = np.abs(np.diff(column, prepend=column[0]))
        movement = moved[max(0, sample - _CAUSE) : sample + 1].max()
        if movement == 0.0:
            continue
        others = np.flatnonzero(moved >= 0.5 * movement)
        following = np.searchsorted(candidates, others)
        answered = following < candidates.size
        answered[answered] = candidates[following[answered]] - others[answered] <= _CAUSE
        unanswered = np.count_nonzero(~answered)
        if unanswered < max(_UNANSWERED, int(np.count_nonzero(answered))):
            return True
    return False


def _find_stuck(y: Signal, u: Signal) -> tuple[tuple[int, int], ...]:
    """Return the parts of a noisy output in which it is exactly constant, within its range, under motion."""
    increments = np.diff(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], increments == 0.0, [False]]).astype(np.int8)))
    runs = [(int(first), int(last) + 1) for first, last in edges.reshape(-1, 2)]
    stuck = [run for run in runs if run[1] - run[0] >= _LEAST_STUCK]
    if not 0 < len(stuck) <= _MOST_STUCK:
        return ()
    is_moving = np.isfinite(increments)
    for first, last in stuck:
        is_moving[first : last - 1] = False
    if not _is_noisy(increments[is_moving]):
        return ()
    extremes = float(np.nanmin(y)), float(np.nanmax(y))
    least = _MOVING * np.ptp(u, axis=0)
    return tuple(
        (first, last)
        for first, last in stuck
        if y[first] not in extremes and bool((np.ptp(u[first:last], axis=0) > least).any())
    )


def _is_noisy(increments: Signal) -> bool:
    """Return whether an output has noise: its curvature alternates where it is small."""
    curvature = np.diff(increments)
    parts = curvature[: curvature.size // _PART * _PART].reshape(-1, _PART)
    if not len(parts) or np.count_nonzero(increments == 0.0) > _RESTING * increments.size:
        return False
    sizes = np.abs(parts).sum(axis=1)
    quiet = parts[sizes <= np.quantile(sizes, _QUIET)]
    return bool(np.mean(quiet[:, 1:] * quiet[:, :-1] < 0.0) >= _ALTERNATING)
