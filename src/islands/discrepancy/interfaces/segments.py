"""Segments of joined signals: functions that must not reach from one recording into the next.

Segments are given by their lengths, as in `Dataset`. No lengths mean a single recording.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]


#: Largest range of a signal that rests, relative to its largest absolute value: rounding.
_MAX_RANGE_AT_REST = 1e-9


def is_resting(signal: Signal) -> bool:
    """Return whether a signal is constant up to rounding."""
    return bool(np.ptp(signal) <= _MAX_RANGE_AT_REST * np.max(np.abs(signal)))


def find_bounds(segments: Sequence[int], samples: int) -> tuple[tuple[int, int], ...]:
    """Return the first sample of every segment and the one after its last, within the first ``samples``."""
    bounds, first = [], 0
    for length in segments or (samples,):
        last = min(first + length, samples)
        if first < last:
            bounds.append((first, last))
        first = last
    return tuple(bounds)


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
