"""Whether the output rests while the inputs rest, as that of a system without relaxation does.

The motion of the output over a few samples in which the inputs rest is compared with its motion while they
move. The output of a hysteresis without dynamics rests at once; that of a system with a time constant goes on
moving for a while. Records in which the inputs never rest are judged at the turning points of the inputs.
"""

from math import nan

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.inspection.blocks import resample, sum_blocks
from islands.records.inspection.fact import Fact
from islands.records.inspection.noise import estimate_noise

#: Interval of a motion in samples: the first one in which the output moves this many noise levels.
_INTERVALS, _NOISE_LEVELS = (2, 3, 5, 10, 20, 50, 100, 200), 4.0

#: Motion of the inputs, relative to the usual one, in which they rest; and in which they nearly rest.
_RESTING, _TURNING = 0.02, 0.2

#: Part of the samples with the smallest motion of the inputs that are judged if the inputs never rest.
_CALMEST = 0.05

#: Samples at rest, at least.
_LEAST_SAMPLES = 20

#: Intervals after the end of a motion of the inputs in which the output is judged.
_AFTER = 5

#: The output rests if it moves less than this, relative to its usual motion, beyond what the inputs move.
_RESTS = 0.15


def check_rest(record: Dataset) -> Fact:
    """Return whether the output rests while all inputs rest.

    Returns
    -------
    Fact
        A yes or no; None if the inputs never rest, nor turn slowly. The confidence is the share of resampled
        records with the same answer.
    """
    interval = _choose_interval(record)
    moved, motion, usable = _measure_motions(record, interval)
    usual = float(np.median(moved[usable])) if usable.any() else 0.0
    most = max(_RESTING * float(np.max(moved, initial=0.0)), _RESTING * usual)
    resting = usable & (moved <= most)
    recently = _any_before(moved > most, _AFTER * interval)
    if np.count_nonzero(resting & recently) < _LEAST_SAMPLES and usual > 0.0:
        most = float(np.quantile(moved[usable], _CALMEST))
        if most > _TURNING * usual:
            return _leave_open(record, 2 * interval)
        resting, recently = usable & (moved <= most), np.ones(len(moved), dtype=bool)
    resting &= recently
    moving = usable & (moved > max(most, usual))
    if min(np.count_nonzero(resting), np.count_nonzero(moving)) < _LEAST_SAMPLES:
        return _leave_open(record, 2 * interval)
    level = estimate_noise(record.y, record)
    noise = 2.0 * level * level
    output = _compare_means(motion - noise, resting, moving)
    inputs = _compare_means(moved**2, resting, moving)
    excess = output - inputs
    rests = bool(np.median(excess) <= _RESTS)
    share = float(np.mean((excess <= _RESTS) == rests))
    # Inputs that move by less than half a per cent are at rest.
    shares = float(np.median(output)), round(float(np.median(inputs)), 2)
    details = {"inputs": record.input_names, "motion": shares}
    finding = "rest_rests" if rests else "rest_moves"
    return Fact("rest", record.output_name, finding, rests, confidence=share, details=details)


def _leave_open(record: Dataset, samples: int) -> Fact:
    """Return a fact without a value: the inputs do not rest for the samples in which the output moves."""
    details = {"inputs": record.input_names, "samples": samples}
    return Fact("rest", record.output_name, "rest_unknown", details=details)


def _choose_interval(record: Dataset) -> int:
    """Return the samples in which the output moves clearly more than its noise."""
    level = _NOISE_LEVELS * estimate_noise(record.y, record)
    for interval in _INTERVALS:
        steps = record.y[interval:] - record.y[:-interval]
        if interval >= record.samples // 20:
            break
        if np.nanmean(steps**2) >= 2.0 * level * level:
            return interval
    return _INTERVALS[0]


def _measure_motions(
    record: Dataset, interval: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return the motion of the inputs over two intervals, the squared motion of the output, and where known.

    The motion of an input is the sum of its absolute increments, relative to its range.
    """
    moved = np.zeros(record.samples)
    for signal in record.u.T:
        if np.ptp(signal) > 0.0:
            increments = np.abs(np.diff(signal, prepend=signal[:1])) / np.ptp(signal)
            path = np.concatenate([[0.0], np.cumsum(increments)])
            last = np.arange(record.samples) + 1
            moved += path[last] - path[np.maximum(last - 2 * interval, 0)]
    motion = np.full(record.samples, nan)
    motion[interval:] = (record.y[interval:] - record.y[:-interval]) ** 2
    usable = np.isfinite(motion)
    for begin, _ in record.bounds:
        usable[begin : begin + 2 * interval] = False
    return moved, np.where(usable, motion, 0.0), usable


def _any_before(condition: NDArray[np.bool_], samples: int) -> NDArray[np.bool_]:
    """Return whether the condition holds in one of the given number of samples before."""
    count = np.concatenate([[0], np.cumsum(condition)])
    last = np.arange(condition.size) + 1
    return np.asarray(count[last] > count[np.maximum(last - samples, 0)])


def _compare_means(
    squares: NDArray[np.float64], resting: NDArray[np.bool_], moving: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the root mean square at rest relative to that in motion, in every resample of the blocks."""
    means = []
    for where in (resting, moving):
        counts = resample(sum_blocks(where.astype(np.float64)))
        sums = resample(sum_blocks(np.where(where, squares, 0.0)))
        means.append(np.maximum(sums, 0.0) / np.maximum(counts, 1.0))
    return np.sqrt(means[0] / np.maximum(means[1], np.finfo(np.float64).tiny))
