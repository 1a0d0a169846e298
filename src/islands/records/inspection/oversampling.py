"""Oversampling: how many samples can be averaged without loss of bandwidth."""

import numpy as np
from numpy.typing import NDArray

from islands.records.averaging import average_samples
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.records.inspection.fact import Fact
from islands.records.inspection.noise import estimate_noise, measure_increments

#: Samples of a mean that are compared.
COUNTS = (1, 2, 5, 10, 20, 50)

#: Smallest noise worth a comparison, relative to the root mean square of the increments of a signal.
_NOISE = 0.2

#: Largest variance of the noise, relative to that of the signal. Without oversampling, all of a signal looks
#: like noise.
_LARGEST_NOISE = 0.1

#: Largest variance within the means, without noise, relative to that of the signal: a sine has 18 means in a
#: period.
_VARIANCE_WITHIN = 0.01

#: Fewest means of a record whose rate is reduced.
_LEAST_MEANS = 300

#: Increments of the output, relative to its standard deviation, from which on samples are far apart.
_FAR = 1.0


def recommend_rate(record: Dataset) -> Fact:
    """Return the longest sampling time whose means keep the bandwidth of all signals.

    Returns
    -------
    Fact
        The value is a multiple of the sampling time, which is recommended itself if no longer one keeps the
        bandwidth or leaves 300 samples.
    """
    counts = [count for count in COUNTS if _has_means(record, count) and keeps_bandwidth(record, count)]
    count = max(counts, default=1)
    dt = count * record.dt
    spread = float(np.std(record.y))
    if count > 1:
        finding = "rate_oversampled"
    elif max(record.segments) < 2:
        finding = "rate_unconnected"
    elif spread > 0.0 and measure_increments(record.y, record) > _FAR * spread:
        finding = "rate_low"
    else:
        finding = "rate_suitable"
    details = {"samples": count, "is_noisy": is_noisy(record), "output": record.output_name}
    return Fact("sampling-time", "", finding, dt, "s", details=details)


def _has_means(record: Dataset, count: int) -> bool:
    early = any(parse_channel_name(name).at_once for name in record.input_names)
    return count == 1 or (
        not early and max(record.segments) >= count and record.samples >= _LEAST_MEANS * count
    )


def keeps_bandwidth(record: Dataset, count: int) -> bool:
    """Return whether means of ``count`` samples have the variance of all signals, except for their noise."""
    if count == 1:
        return True
    means = average_samples(record, count)
    pairs = [(record.y, means.y), *zip(record.u.T, means.u.T, strict=True)]
    return all(_keeps_variance(fine, coarse, count, record) for fine, coarse in pairs)


def _keeps_variance(
    fine: NDArray[np.float64], coarse: NDArray[np.float64], count: int, record: Dataset
) -> bool:
    variance = float(np.var(fine))
    noise = estimate_noise(fine, record)
    noise = min(noise * noise, _LARGEST_NOISE * variance)
    lost = variance - float(np.var(coarse))
    return lost <= _VARIANCE_WITHIN * variance + noise * (1.0 - 1.0 / count)


def is_noisy(record: Dataset) -> bool:
    """Return whether the noise of a signal is a large part of its increments."""
    return any(
        estimate_noise(signal, record) > _NOISE * measure_increments(signal, record)
        for signal in (record.y, *record.u.T)
    )
