"""Filters that effects share: low-pass responses and fractional delays."""

from math import exp, factorial

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Signal

#: Coefficients of s^0 to s^3, one row for each of the neighbours at -1, 0, 1, 2: Lagrange's polynomials.
_LAGRANGE = np.array(
    [
        [0.0, -1 / 3, 1 / 2, -1 / 6],
        [1.0, -1 / 2, -1.0, 1 / 2],
        [0.0, 1.0, 1 / 2, -1 / 2],
        [0.0, -1 / 6, 0, 1 / 6],
    ]
)

#: From which steps in time constants on moments are computed by recursion, and terms of their series below.
_LONG, _TERMS = 1.0, 20


def low_pass(signal: Signal, tau: float, dt: float) -> Signal:
    """Return what follows a signal with a time constant, exactly for a cubic through four neighbours.

    A straight line between samples would do for slow signals alone: of ten samples a period it makes a lag
    of half a sample look like something else.
    """
    step = dt / tau
    weights = _LAGRANGE @ _moments(step)
    start = signal[0]
    seen = np.concatenate([[0.0], signal - start, [signal[-1] - start]])
    moved = np.convolve(seen, weights[::-1], mode="valid")
    followed = scipy.signal.lfilter([1.0], [1.0, -exp(-step)], moved)
    return np.concatenate([[start], followed + start])


def _moments(step: float) -> Signal:
    """Return the integrals of ``step exp(-step (1 - s)) s^n`` over s from 0 to 1, n from 0 to 3."""
    if step < _LONG:
        return np.array(
            [
                step * exp(-step) * sum(step**m / (factorial(m) * (n + m + 1)) for m in range(_TERMS))
                for n in range(4)
            ]
        )
    moments = [1.0 - exp(-step)]
    for n in range(1, 4):
        moments.append(1.0 - n / step * moments[-1])
    return np.array(moments)


#: Neighbours that an interpolation goes through: with four, a signal of ten samples a period is out by as
#: much as a delay of a hundredth of a sample.
_NEIGHBOURS = (-2, -1, 0, 1, 2, 3)


def interpolate_at(signal: Signal, at: Signal) -> Signal:
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
