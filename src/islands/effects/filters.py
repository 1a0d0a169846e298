"""First-order low-pass that several effects use."""

from functools import lru_cache
from math import exp, factorial

import numpy as np

from islands.effects.interface.context import Signal
from islands.kernels.linear_filter import low_pass_cubic

#: Coefficients of s^0 to s^3 of the cubic Lagrange polynomials, one row for each neighbour at -1, 0, 1, 2.
_LAGRANGE = np.array(
    [
        [0.0, -1 / 3, 1 / 2, -1 / 6],
        [1.0, -1 / 2, -1.0, 1 / 2],
        [0.0, 1.0, 1 / 2, -1 / 2],
        [0.0, -1 / 6, 0, 1 / 6],
    ]
)

#: Step, relative to the time constant, from which the moments are computed by recursion; by series below it.
_RECURSION_STEP = 1.0

#: Terms of the series of the moments.
_SERIES_TERMS = 20


def low_pass(signal: Signal, tau: float, dt: float) -> Signal:
    """Filter a signal with a first-order low-pass; exact if the signal is a cubic through four neighbours.

    Linear interpolation between samples is accurate for slow signals only: at ten samples per period, its
    error makes a lag of half a sample look like another effect.
    """
    step = dt / tau
    filtered: Signal = low_pass_cubic(signal, _compute_weights(step), exp(-step))
    return filtered


@lru_cache(maxsize=256)
def _compute_weights(step: float) -> Signal:
    """Return the weights of four neighbours; a calibration needs those of few time constants."""
    return np.array(_LAGRANGE @ _moments(step))


def _moments(step: float) -> Signal:
    """Return the integrals of ``step exp(-step (1 - s)) s^n`` over s from 0 to 1, n from 0 to 3."""
    if step < _RECURSION_STEP:
        return np.array(
            [
                step * exp(-step) * sum(step**m / (factorial(m) * (n + m + 1)) for m in range(_SERIES_TERMS))
                for n in range(4)
            ]
        )
    moments = [1.0 - exp(-step)]
    for n in range(1, 4):
        moments.append(1.0 - n / step * moments[-1])
    return np.array(moments)
