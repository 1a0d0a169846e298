"""Segments of joined signals: functions that must not reach from one recording into the next.

Segments are given by their lengths, as in `Dataset`. No lengths mean a single recording.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]


#: Largest range of a signal that rests, relative to its largest absolute value: rounding.
MAX_RANGE_AT_REST = 1e-9


def is_resting(signal: Signal) -> bool:
    """Return whether a signal is constant up to rounding."""
    return bool(np.ptp(signal) <= MAX_RANGE_AT_REST * np.max(np.abs(signal)))


def find_bounds(segments: Sequence[int], samples: int) -> tuple[tuple[int, int], ...]:
    """Return the first sample of every segment and the one after its last, within the first ``samples``."""
    bounds, first = [], 0
    for length in segments or (samples,):
        last = min(first + length, samples)
        if first < last:
            bounds.append((first, last))
        first = last
    return tuple(bounds)


def find_runs(is_known: NDArray[np.bool_], segments: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return the first sample of every run of known samples in a segment, and the one after its last."""
    runs = []
    for first, last in find_bounds(segments, is_known.size):
        edges = np.flatnonzero(np.diff(is_known[first:last].astype(np.int8), prepend=0, append=0))
        runs += [(first + int(begin), first + int(end)) for begin, end in edges.reshape(-1, 2)]
    return tuple(runs)


def count_runs(is_known: NDArray[np.bool_], segments: Sequence[int]) -> tuple[int, ...]:
    """Return the lengths of the runs of known samples; the segments themselves if no sample is missing."""
    if is_known.all():
        return tuple(segments)
    return tuple(last - first for first, last in find_runs(is_known, segments))


def split_at_gaps(is_known: NDArray[np.bool_], segments: Sequence[int]) -> tuple[int, ...]:
    """Return the lengths of segments that are cut where known samples begin or end.

    An equation of a noise model reaches across neither the gap nor its ends.
    """
    if is_known.all():
        return tuple(segments)
    runs = find_runs(is_known, segments)
    ends = {end for run in runs for end in run}
    ends |= {last for _, last in find_bounds(segments, is_known.size)}
    return tuple(np.diff([0, *sorted(ends - {0})]).tolist())


def fill_gaps(signal: Signal) -> Signal:
    """Return a signal whose missing samples are interpolated linearly; the ends are held."""
    is_known = ~np.isnan(signal)
    if is_known.all() or not is_known.any():
        return signal
    places = np.arange(signal.size)
    return np.interp(places, places[is_known], signal[is_known])


def map_segments(function: Callable[[Signal], Signal], signal: Signal, segments: Sequence[int]) -> Signal:
    """Apply a function to every segment of a signal, and concatenate the results.

    Parameters
    ----------
    function : callable
        Function of a signal of shape (samples,); its result may have another length.
    signal : ndarray, shape (samples,)
        It may end before the last segment.
    segments : sequence of int
        Lengths of the segments in samples.
    """
    bounds = find_bounds(segments, len(signal))
    if len(bounds) <= 1:
        return function(signal)
    return np.concatenate([function(signal[first:last]) for first, last in bounds])


def delay_samples(signal: Signal, lag: int) -> Signal:
    """Return a signal some samples late, shape (samples,); until then it has its first value."""
    return np.concatenate([np.full(min(lag, signal.size), signal[0]), signal])[: signal.size]


def take_backward_differences(signal: Signal) -> Signal:
    """Return the differences of a signal to its previous sample, shape (samples,); the first one is zero.

    Central differences contain the next sample. In closed loop, that of the input depends on the current
    residual.
    """
    return np.diff(signal, prepend=signal[:1])
