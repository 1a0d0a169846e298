"""Level of the white noise of a signal, from differences of high order.

Differences of high order of a signal that is sampled densely enough vanish; those of its noise do not. If
differences of several orders give the same level, it is that of noise. Otherwise the signal itself changes
within a few samples, and the smallest level is an upper bound.
"""

from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.inspection.channel import Channel, channels
from islands.records.inspection.fact import Fact
from islands.records.inspection.quantisation import find_quantisation
from islands.rounding import NORMAL_MEDIAN

#: Order of the differences that separate the noise from the signal.
_ORDER = 4

#: Orders that have to agree, and the largest ratio of their levels.
_ORDERS, _AGREEMENT = (4, 6, 8), 1.2

#: Level, relative to the standard deviation, from which on a signal without noise looks like noise.
_ROUGH = 0.1

#: Level, relative to the range, that is no more than rounding.
_INVISIBLE = 1e-7

#: Blocks that give the interval of a noise level.
_BLOCKS = 16


def measure_noise(channel: Channel, record: Dataset, quantisation: Fact) -> Fact:
    """Return the standard deviation of the white noise of a signal.

    Parameters
    ----------
    channel : Channel
        A signal of the record.
    record : Dataset
    quantisation : Fact
        Quantisation of the signal, which noise below one step cannot be separated from.

    Returns
    -------
    Fact
        The value is None if the signal changes too much between two samples; the sentence then states an
        upper bound.
    """
    name, unit = channel.name, channel.unit
    levels = [estimate_noise(channel.values, record, order) for order in _ORDERS]
    step = float(quantisation.value or 0.0)
    if step and min(levels) <= step:
        return Fact("noise", name, "noise_below_step", unit=unit, details={"step": step})
    extent = float(np.ptp(channel.known))
    if min(levels) <= _INVISIBLE * extent:
        return Fact("noise", name, "noise_invisible", unit=unit)
    details = {"level": min(levels), "percent": 100 * min(levels) / extent}
    if max(levels) > _AGREEMENT * min(levels) or _may_be_signal(channel, record, min(levels)):
        return Fact("noise", name, "noise_bound", unit=unit, details=details)
    value = levels[0]
    cuts = np.linspace(0, record.samples, _BLOCKS + 1).astype(int)
    parts = [
        estimate_noise(channel.values[first:last], record[first:last])
        for first, last in pairwise(cuts.tolist())
        if last - first > 4 * _ORDER
    ]
    error = 2.0 * float(np.std(parts)) / len(parts) ** 0.5 if len(parts) > 1 else value
    interval = (max(0.0, value - error), value + error)
    return Fact("noise", name, "noise_white", value, unit, interval, details=details | {"level": value})


def measure_output_noise(record: Dataset) -> float | None:
    """Return the standard deviation of the white noise of the output; None if it cannot be separated."""
    *_, output = channels(record)
    return measure_noise(output, record, find_quantisation(output)).value


def _may_be_signal(channel: Channel, record: Dataset, level: float) -> bool:
    """Return whether a level may be that of the signal: a fast input, or an output that responds to one."""
    sources = record.u.T if channel.is_output else (channel.values,)
    if any(estimate_noise(signal, record) > _ROUGH * float(np.std(signal)) > 0.0 for signal in sources):
        return True
    return level > 5.0 * _ROUGH * float(np.std(channel.known))


def estimate_noise(signal: NDArray[np.float64], record: Dataset, order: int = _ORDER) -> float:
    """Return the standard deviation of the white noise of a signal.

    The median ignores the steps of an input.

    Parameters
    ----------
    signal : ndarray, shape (samples,)
        A signal of the record. Differences with a missing value are left out.
    record : Dataset
        Record whose segments no difference crosses.
    order : int
        Order of the differences.
    """
    differences = np.concatenate([np.diff(signal[first:last], order) for first, last in record.bounds])
    size = np.abs(differences[np.isfinite(differences)])
    return float(np.median(size) / (NORMAL_MEDIAN * comb(2 * order, order) ** 0.5)) if size.size else 0.0


def measure_increments(signal: NDArray[np.float64], record: Dataset) -> float:
    """Return the root mean square of the increments of a signal; zero if no sample follows another."""
    increments = np.concatenate([np.diff(signal[first:last]) for first, last in record.bounds])
    return float(np.sqrt(np.mean(increments**2))) if increments.size else 0.0
