"""A signal at times between its samples."""

import numpy as np

from islands.discrepancy.effect import Signal


def at_samples(signal: Signal, at: Signal) -> Signal:
    """Interpolate through four neighbours at positions counted in samples; the ends are held."""
    last = signal.size - 1
    at = np.clip(at, 0.0, last)
    first = np.minimum(at.astype(np.int64), max(last - 1, 0))
    f = at - first
    before, behind = signal[np.maximum(first - 1, 0)], signal[np.minimum(first + 2, last)]
    here, there = signal[first], signal[np.minimum(first + 1, last)]
    interpolated: Signal = (
        -f * (f - 1) * (f - 2) / 6 * before
        + (f + 1) * (f - 1) * (f - 2) / 2 * here
        - (f + 1) * f * (f - 2) / 2 * there
        + (f + 1) * f * (f - 1) / 6 * behind
    )
    return interpolated
