"""Excitation: what an input makes visible, by its spectrum, its amplitudes and its persistence."""

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.flat_extremes import TWO, count_levels
from islands.records.inspection.channel import Channel
from islands.records.inspection.fact import Fact

#: Part of the power outside the stated band, half of it on either side.
_OUTSIDE = 0.05

#: Samples of a periodogram, at most. They bound the resolution and the time.
_PERIODOGRAM = 4096

#: Most levels that are counted; a signal with more is continuous.
_MOST_LEVELS = 50

#: Equal parts of the range, and samples in a part that is covered, relative to an even distribution.
_PARTS, _COVERED = 20, 0.1

#: Largest order of persistent excitation that is tested.
_MOST_ORDER = 50

#: Rows of lagged inputs, at most.
_ROWS = 8000

#: Smallest power in any direction of lagged inputs, relative to the variance of the input.
_LEAST_POWER = 1e-5


def measure_excitation(channel: Channel, record: Dataset) -> tuple[Fact, ...]:
    """Return the facts ``band``, ``levels``, ``coverage`` and ``excitation-order`` of an input.

    Parameters
    ----------
    channel : Channel
        An input of the record, not constant.
    record : Dataset
    """
    return (
        _measure_band(channel, record),
        _count_levels(channel),
        _measure_coverage(channel),
        _find_order(channel, record),
    )


def estimate_spectrum(
    values: NDArray[np.float64], dt: float, length: int = _PERIODOGRAM, centres_parts: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies in hertz and the power density of a signal without its mean (Welch 1967).

    Parts with a Hann window overlap by half. `scipy.signal.welch` computes the same, but its import takes
    half a second.

    Parameters
    ----------
    values : ndarray, shape (samples,)
    dt : float
        Sampling time in seconds.
    length : int
        Largest length of a part in samples.
    centres_parts : bool
        Whether each part is taken without its own mean, and not without that of the signal.
    """
    length = min(len(values), length)
    window = np.hanning(length + 1)[:-1]
    centred = values if centres_parts else values - values.mean()
    parts = np.lib.stride_tricks.sliding_window_view(centred, length)[:: length - length // 2]
    if centres_parts:
        parts = parts - parts.mean(axis=1, keepdims=True)
    power: NDArray[np.float64] = (
        np.mean(np.abs(np.fft.rfft(window * parts)) ** 2, axis=0) * dt / np.sum(window**2)
    )
    power[1 : (length + 1) // 2] *= 2.0  # negative frequencies; half the sampling rate has none
    return np.asarray(np.fft.rfftfreq(length, dt), np.float64), power


def _measure_band(channel: Channel, record: Dataset) -> Fact:
    """Return the frequency below which 97.5 % of the power is, with the band of 95 % as interval."""
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    frequency, power = estimate_spectrum(channel.values[begin:end], record.dt)
    part = np.cumsum(power) / power.sum()
    low, high = (float(np.interp(edge, part, frequency)) for edge in (0.5 * _OUTSIDE, 1.0 - 0.5 * _OUTSIDE))
    details = {"nyquist": 0.5 / record.dt}
    return Fact("band", channel.name, "band", high, "Hz", (low, high), details=details)


def _count_levels(channel: Channel) -> Fact:
    levels = count_levels(channel.known)
    if levels > _MOST_LEVELS:
        return Fact("levels", channel.name, "levels_many")
    details = {"levels": levels, "is_binary": levels == TWO}
    return Fact("levels", channel.name, "levels_few", float(levels), details=details)


def _measure_coverage(channel: Channel) -> Fact:
    known = channel.known
    counts = np.histogram(known, _PARTS)[0]
    share = float(np.mean(counts >= _COVERED * known.size / _PARTS))
    return Fact("coverage", channel.name, "coverage", share)


def _find_order(channel: Channel, record: Dataset) -> Fact:
    """Return the largest number of lagged inputs that are linearly independent (Ljung 1999, section 13.2)."""
    centred = channel.values - channel.values.mean()
    most = min(_MOST_ORDER, max(record.segments) // 4)
    if most < 1 or not np.ptp(centred) > 0.0:
        return Fact("excitation-order", channel.name, "excitation_short")
    centred /= np.abs(centred).max()
    rows = np.concatenate([np.arange(begin + most, end) for begin, end in record.bounds])
    rows = rows[np.arange(min(_ROWS, rows.size)) * rows.size // min(_ROWS, rows.size)]
    lagged = np.array([centred[rows - lag] for lag in range(1, most + 1)])
    covariance = np.einsum("ir,jr->ij", lagged, lagged) / (rows.size * float(np.var(centred)))
    order = 0
    for size in range(1, most + 1):
        if np.linalg.eigvalsh(covariance[:size, :size])[0] < _LEAST_POWER:
            break
        order = size
    details = {"order": order, "is_bound": order == most}
    return Fact("excitation-order", channel.name, "excitation_order", float(order), details=details)
