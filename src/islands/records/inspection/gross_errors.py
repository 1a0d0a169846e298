"""Gross errors of a measured output: codes of missing values, isolated spikes, and a stuck sensor.

Least squares follows a single value far outside of the range, so gross errors are found before an estimation.
All criteria are strict: an output that is only fast, nonlinear or noisy has no gross errors.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from islands.records.segments import fill_gaps
from islands.rounding import ROUNDING

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

#: Lags of the linear prediction; part of the samples it is fitted without, those farthest from their
#: neighbours; and part of the variance that it explains, at least: otherwise no sample is unexpected.
_LAGS, _FARTHEST, _EXPLAINED = 3, 0.05, 0.5

#: Samples on either side that confirm an excursion, and of the longest excursion.
_AROUND, _LONGEST = 2, 5

#: Part of the errors of the prediction that are larger than usual, and of the samples that are excursions, at
#: most.
_LARGE, _MOST_EXCURSIONS = 0.1, 0.02

#: Tail index of normal noise near its 90 % quantile.
_LIGHT_TAIL = 0.25

#: Probability that the tail of the other excursions reaches the largest ones, at most.
_REACHED = 1e-3

#: Samples whose neighbours are compared with those of an excursion, at most and at least.
_DRAWN, _LEAST_DRAWN = 2000, 20

#: Samples before an excursion in which an input may cause it, and the probability that an input is as active
#: there by chance, at most.
_CAUSES, _BY_CHANCE = (2, 8, 32), 0.05

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
        Inputs. An excursion that follows an unusual activity of an input is a response.
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
    """Return the samples of excursions that neither their neighbours nor the inputs explain.

    A linear prediction from past outputs and inputs describes the motion of the system. A physical event
    changes the state: the samples after it are displaced, by a fraction of the event that the record may
    show nowhere else. A gross error is in the measurement alone: one prediction fails, and the samples after
    it go on as if it had not been (an additive and not an innovational outlier; Fox 1972). It is also larger
    than the jumps that last, and than the tail of all other excursions of the record reaches, and follows no
    activity of an input.
    """
    none = np.zeros(0, np.int64)
    known = np.isfinite(y)
    if np.count_nonzero(known) <= _LEAST_DRAWN:
        return none
    prediction = _Prediction.fit(y, u, known)
    if prediction is None:
        return none
    excursions: list[NDArray[np.int64]] = []
    while found := _find_excursions(prediction):
        excursions += [np.arange(first, first + length) for first, length in found]
    return np.sort(np.concatenate([none, *excursions]))


class _Prediction:
    """Linear prediction of the output from past outputs and from inputs.

    Attributes
    ----------
    y, u : ndarray
        The signals, with a standard deviation of 1.
    errors : ndarray, shape (samples,)
        Errors of the prediction; NaN if a value is missing.
    """

    def __init__(self, y: Signal, u: Signal, weights: Signal, drive: Signal) -> None:
        self.y, self.u, self._weights, self._drive = y, u, weights, drive
        self.errors = np.full(y.size, np.nan)
        self._update(_LAGS, y.size)

    @classmethod
    def fit(cls, y: Signal, u: Signal, known: Mask) -> "_Prediction | None":
        """Fit the prediction without the samples that are farthest from their neighbours."""
        filled = np.interp(np.arange(y.size), np.flatnonzero(known), y[known])
        width = 2 * _LAGS + 1
        neighbours = np.lib.stride_tricks.sliding_window_view(np.pad(filled, _LAGS, mode="reflect"), width)
        distance = np.abs(filled - np.median(neighbours, axis=1))
        if not distance.max() > ROUNDING * np.abs(filled).max():
            return None
        usual = known & (distance <= np.quantile(distance[known], 1.0 - _FARTHEST))
        # Squares of the largest numbers have no value.
        y, u = y / np.abs(y[known]).max(), u / np.maximum(np.abs(u).max(axis=0), np.finfo(np.float64).tiny)
        y, spread = (y - np.median(y[known])) / np.std(y[known]), np.std(u, axis=0)
        u = (u[:, spread > 0.0] - u.mean(axis=0)[spread > 0.0]) / spread[spread > 0.0]
        samples = np.arange(_LAGS, y.size)
        past = [y[samples - lag] for lag in range(1, _LAGS + 1)]
        inputs = [column[samples - lag] for column in u.T for lag in range(_LAGS + 1)]
        driving = np.column_stack([np.ones(samples.size), *inputs, *(each**2 for each in inputs)])
        terms = np.column_stack([*past, driving])
        rows = np.all([usual[samples - lag] for lag in range(_LAGS + 1)], axis=0)
        if np.count_nonzero(rows) < 2 * terms.shape[1]:
            return None
        theta, target = np.linalg.lstsq(terms[rows], y[samples][rows], rcond=1e-10)[0], y[samples][rows]
        if not np.mean((target - terms[rows] @ theta) ** 2) <= (1.0 - _EXPLAINED) * np.var(target):
            return None
        return cls(y, u, theta[:_LAGS], np.concatenate([np.zeros(_LAGS), driving @ theta[_LAGS:]]))

    def _update(self, first: int, last: int) -> None:
        samples = np.arange(first, last)
        past = np.column_stack([self.y[samples - lag] for lag in range(1, _LAGS + 1)])
        self.errors[samples] = self.y[samples] - self._drive[samples] - past @ self._weights

    def replace(self, first: int, length: int) -> None:
        """Replace samples by their prediction."""
        for sample in range(first, first + length):
            self._update(sample, sample + 1)
            self.y[sample] -= self.errors[sample]
        self._update(first, min(first + length + _LAGS, self.y.size))

    def leave_out(self, firsts: NDArray[np.int64], length: int) -> tuple[Signal, Signal]:
        """Predict as if runs of samples were missing.

        Returns
        -------
        size : ndarray, shape (runs,)
            Least error within each run, which is 0 if a value is missing.
        displacement : ndarray, shape (runs,)
            Largest error around each run.
        """
        places = firsts[:, None] + np.arange(-_LAGS, length + _AROUND)
        exists = places < self.y.size
        places = np.minimum(places, self.y.size - 1)
        measured = self.y[places]
        used, errors = measured.copy(), np.empty((firsts.size, length + _AROUND))
        for place in range(length + _AROUND):
            at = _LAGS + place
            predicted = self._drive[places[:, at]] + used[:, at - _LAGS : at][:, ::-1] @ self._weights
            errors[:, place] = np.where(exists[:, at], np.abs(measured[:, at] - predicted), np.nan)
            if place < length:
                used[:, at] = predicted
        size = errors[:, : length + 1].min(axis=1)
        size = np.where(np.isfinite(size), errors[:, :length].min(axis=1), 0.0)
        before = np.abs(self.errors[firsts[:, None] - np.arange(1, _AROUND + 1)])
        around = np.concatenate([errors[:, length:], before], axis=1)
        return size, np.where(np.isnan(around), 0.0, around).max(axis=1)


def _find_excursions(prediction: _Prediction) -> list[tuple[int, int]]:
    """Return first sample and length of the runs that the samples around them contradict."""
    errors = np.abs(prediction.errors)
    known = np.isfinite(errors)
    usual = max(float(np.quantile(errors[known], 1.0 - _LARGE)), ROUNDING)
    firsts = np.flatnonzero(known & (errors > usual))
    tried = np.array([prediction.leave_out(firsts, length) for length in range(1, _LONGEST + 1)])
    # An excursion ends where the samples after it go on as those before it.
    best = np.argmin(tried[:, 1] / np.maximum(tried[:, 0], ROUNDING), axis=0)
    lengths, (sizes, displacements) = best + 1, tried[best, :, np.arange(firsts.size)].T
    undone = sizes - displacements
    isolated, free = [], known.copy()
    for place in np.argsort(-undone, kind="stable")[: np.count_nonzero(undone > usual)]:
        first = firsts[place]
        # The errors after a large excursion are its response in the prediction.
        if free[first]:
            isolated.append(place)
            free[max(first - _LONGEST, 0) : first + _LONGEST + _LAGS] = False
    count = _count_isolated(np.log(undone[isolated] / usual), errors.size)
    free = known.copy()
    free[-_LONGEST - _AROUND :] = False
    least = min(undone[isolated[:count]], default=np.inf)
    for first in firsts[undone >= least]:
        free[max(first - _LONGEST - _AROUND, 0) : first + _LONGEST + _LAGS] = False
    drawn = np.flatnonzero(free)
    if drawn.size < _LEAST_DRAWN:
        return []
    drawn = drawn[np.linspace(0, drawn.size - 1, min(_DRAWN, drawn.size)).astype(np.int64)]
    displace = cache(lambda length: np.sort(prediction.leave_out(drawn, length)[1]))
    found: list[tuple[int, int]] = []
    caused = _find_caused(firsts[isolated[:count]], prediction.u)
    for place in isolated[:count]:
        first, length, displacement = int(firsts[place]), int(lengths[place]), displacements[place]
        ordinary = displace(length)
        within = np.diff(np.searchsorted(ordinary, [0.5 * displacement, 2.0 * displacement]))[0]
        # A physical event leaves any fraction of itself: its displacement is uniform up to its size.
        is_error = (within + 1) / (ordinary.size + 1) > 1.5 * displacement / sizes[place]
        # Where more jumps last than excursions begin, an excursion may be two of them, there and back.
        jumps = np.count_nonzero(errors[free] >= 0.5 * sizes[place])
        if is_error and jumps <= count * (_LAGS + 1) and first not in caused:
            found.append((first, length))
    for first, length in found:
        prediction.replace(first, length)
    return found


def _count_isolated(logarithms: Signal, samples: int) -> int:
    """Return how many of the largest excursions the tail of the others does not reach.

    In a tail of the index xi, the logarithm of the ratio of the j-th to the next value is exponential with
    the mean xi / j (Renyi 1953). The index is estimated above and below the ratio (Hill 1975).

    Parameters
    ----------
    logarithms : ndarray, shape (excursions,)
        Logarithms of the excursions relative to the usual errors, the largest first.
    samples : int
        Samples of the record.
    """
    most = min(max(int(_MOST_EXCURSIONS * samples), 1), logarithms.size)
    if most < 1:
        return 0
    logarithms = np.append(logarithms, 0.0)
    counts, sums = np.arange(1, most + 1), np.cumsum(logarithms)
    above = sums[:most] / counts - logarithms[:most]
    below = (sums[-1] - sums[:most]) / np.maximum(np.count_nonzero(logarithms) - counts, 1)
    index = np.maximum(np.maximum(above, below), _LIGHT_TAIL)
    chances = counts / index * (logarithms[1 : most + 1] - logarithms[:most])
    return int(counts[np.argmin(chances)]) if chances.min() < np.log(_REACHED) else 0


def _find_caused(firsts: NDArray[np.int64], u: Signal) -> set[int]:
    """Return the excursions that follow an activity of an input more often than by chance.

    The activity of an input is its distance from its median, or its movement.
    """
    if not firsts.size:
        return set()
    # The import is as long as the reading of a small file.
    from scipy.special import betainc  # noqa: PLC0415

    caused: set[int] = set()
    while (left := np.array([each for each in np.sort(firsts) if each not in caused])).size:
        best, found = _BY_CHANCE, left[:0]
        for column in u.T:
            for activity in (np.abs(column - np.median(column)), np.abs(np.diff(column, prepend=column[0]))):
                for length in _CAUSES:
                    padded = np.concatenate([np.full(length, activity[0]), activity])
                    highest = np.lib.stride_tricks.sliding_window_view(padded, length + 1).max(axis=1)
                    ranks = 1.0 - np.searchsorted(np.sort(highest), highest[left]) / highest.size
                    # Excursions within one window are not independent.
                    alone = np.sort(ranks[np.diff(left, prepend=-length - 1) > length])
                    counts = np.arange(1, alone.size + 1)
                    # The binomial distribution, as an incomplete beta function.
                    chances = betainc(counts, alone.size - counts + 1, alone)
                    place = int(np.argmin(chances))
                    chance = 2 * u.shape[1] * len(_CAUSES) * alone.size * chances[place]
                    if chance < best:
                        best, found = chance, left[ranks <= alone[place]]
        if not found.size:
            break
        caused |= set(found.tolist())
    return caused


def _find_stuck(y: Signal, u: Signal) -> tuple[tuple[int, int], ...]:
    """Return the parts of a noisy output in which it is exactly constant, within its range, under motion.

    The output at rest is constant, too, until it responds to the first motion: motion in the last samples of
    a part does not count.
    """
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
        if y[first] not in extremes and bool((np.ptp(u[first : last - _LAGS], axis=0) > least).any())
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
