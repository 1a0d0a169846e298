"""A signal at times between its samples."""

import numpy as np

from islands.discrepancy.interfaces.effect import Signal

#: Neighbours that an interpolation goes through: with four, a signal of ten samples a period is out by as
#: much as a delay of a hundredth of a sample.
_NEIGHBOURS = (-2, -1, 0, 1, 2, 3)


def at_samples(signal: Signal, at: Signal) -> Signal:
    """Interpolate through six neighbours (Lagrange) at positions counted in samples; the ends are held."""
    last = signal.size - 1
    at = np.clip(at, 0.0, last)
    first = np.minimum(at.astype(np.int64), max(last - 1, 0))
    f = at - first
    interpolated = np.zeros_like(at)
    for here in _NEIGHBOURS:
        weight = signal[np.clip(first + here, 0, last)]
        for other in _NEIGHBOURS:
            if other != here:
                weight = weight * ((f - other) / (here - other))
        interpolated += weight
    return interpolated
