"""Dead time between an input and the output, with its confidence.

The dead time is searched at the rate of the record. If it is long, means of several samples locate it first.
See `islands.inspection.lag_comparison`.
"""

from math import ceil, floor

import numpy as np

from islands.data.averaging import average_samples
from islands.data.dataset import Dataset
from islands.inspection.fact import Fact
from islands.inspection.lag_comparison import FRACTIONS, LARGEST, Onset, compare_lags

#: Means of this many samples search for dead times that are longer than `LARGEST`.
_COARSE = (4, 16)

#: Part of the increments of an input that its past does not predict, for full confidence.
_FULL_INNOVATION = 0.3

#: Confidence, at most: the resamples of one record agree more often than records do.
_MOST_CONFIDENCE = 0.99

#: Confidence from which on the value is stated without reservation.
_LEAST_CONFIDENCE = 0.5


def estimate_dead_time(record: Dataset, place: int) -> Fact:
    """Estimate how many samples after an input the output begins to respond.

    The value is the smallest lag d of the input, u(k-d), to which y(k) responds. It is 1 for a system
    without dead time with an input that is held between two samples, and 0 if the output responds within the
    sample.

    Parameters
    ----------
    record : Dataset
        Rows with a missing output are left out.
    place : int
        Index of the input, from 0.

    Returns
    -------
    Fact
        The confidence is the probability that the value is right within one sample, reduced for an input that
        its past predicts for the most part. The value is None if the
        record is too short, if the past of the input predicts it (a sine), or if no response is visible.
    """
    name = record.input_names[place]
    onset = _find_onset(record, place)
    if isinstance(onset, str):
        return Fact("dead-time", name, None, "samples", None, None, onset)
    value = round(onset.lag)
    first, last = np.percentile(onset.resampled, [2.5, 97.5])
    interval = (float(min(value, max(0, floor(first)))), float(max(value, ceil(last))))
    right = float(np.mean(np.abs(onset.resampled - value) <= 1.0))
    right = min(right * min(1.0, onset.innovation / _FULL_INNOVATION), _MOST_CONFIDENCE)
    response = f"{record.output_name} responds to {name}"
    sentence = _describe(response, value, record.dt, (int(interval[0]), int(interval[1])), right)
    return Fact("dead-time", name, float(value), "samples", interval, right, sentence)


def _describe(response: str, value: int, dt: float, interval: tuple[int, int], right: float) -> str:
    low, high = interval
    after = f"after {_count(value)} ({value * dt:.4g} s)" if value else "within the sample"
    between = f"between {low} and {_count(high)} with a probability of 95 %" if low < high else ""
    chance = f"right within one sample with a probability of {100 * right:.0f} %."
    if right < _LEAST_CONFIDENCE and between:
        return f"It is uncertain when {response}: {between}; the estimate, {after}, is {chance}"
    return f"{response} {', '.join(filter(None, (after, between)))}; {chance}"


def _count(samples: int) -> str:
    return f"{samples} sample" if samples == 1 else f"{samples} samples"


def _find_onset(record: Dataset, place: int) -> Onset | str:
    """Return the first lag at the rate of the record; if it is long, search in coarser records first."""
    found = compare_lags(record, place, 0)
    if not isinstance(found, str) and found.lag < 0.5 * LARGEST:
        return found
    for count in _COARSE:
        if max(record.segments) < count:
            break
        coarse = compare_lags(average_samples(record, count), place, 0)
        if isinstance(coarse, str) or coarse.lag >= LARGEST:
            continue
        if not isinstance(found, str) and count * (coarse.lag - 2) <= found.lag < LARGEST:
            return found
        fine = compare_lags(record, place, max(0, count * (floor(coarse.lag) - 2)))
        return _refine(coarse, count) if isinstance(fine, str) else fine
    return found


def _refine(coarse: Onset, count: int) -> Onset:
    """Return a first lag of means of ``count`` samples in samples, uniformly distributed within a mean."""
    return Onset(coarse.lag * count, coarse.resampled * count + (FRACTIONS - 0.5) * count, coarse.innovation)
