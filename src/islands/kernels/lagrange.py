"""Interpolation of a signal through six neighbours by Lagrange's polynomials."""

import numpy as np

from islands.kernels.jit_cache import kernel


@kernel
def _interpolate(signal, at, out):
    """Interpolate ``signal`` at positions in samples; the end values are held. Write ``out``.

    With four neighbours, the error for a signal of ten samples per period is as large as that of a delay of a
    hundredth of a sample.
    """
    last = signal.size - 1
    for k in range(at.size):
        place = at[k]
        if place < 0.0:
            place = 0.0
        elif place > last:
            place = float(last)
        first = 0 if np.isnan(place) else min(int(place), max(last - 1, 0))
        f = place - first
        total = 0.0
        for here in range(-2, 4):
            weight = signal[min(max(first + here, 0), last)]
            for other in range(-2, 4):
                if other != here:
                    weight = weight * ((f - other) / (here - other))
            total += weight
        out[k] = total


def interpolate_at(signal, at):
    """Return a signal (samples,) at positions in samples, shape (positions,); the end values are held."""
    out = np.empty(at.size)
    _interpolate(np.ascontiguousarray(signal), np.ascontiguousarray(at), out)
    return out
