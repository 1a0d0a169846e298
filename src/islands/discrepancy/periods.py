"""Repeated periods: where an input repeats itself, what its output does not repeat is noise."""

import numpy as np

from islands.discrepancy.effect import Signal

#: The shortest period in samples, and what two of them may differ by, in standard deviations of the input.
SHORTEST, ALIKE = 16, 1e-3


def period_of(u: Signal) -> int | None:
    """Return after how many samples an input repeats itself; None where it does not, or not twice over."""
    n = u.size
    centred = u - u.mean()
    spread = float(np.std(u))
    power = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[: n // 2 + 1]
    overlap = power / (n - np.arange(power.size)) / max(spread**2, np.finfo(float).tiny)
    for lag in np.flatnonzero(overlap > 0.9):
        if lag < SHORTEST:
            continue
        if float(np.std(u[lag:] - u[:-lag])) < ALIKE * spread:
            return int(lag)
    return None


def repeated_noise(u: Signal, y: Signal) -> float | None:
    """Return the mean square of an output's noise from periods that repeat; None where none do.

    The first period is left out: whatever was before it dies away in it. What is level in the difference of
    two is drift, and no noise.

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
    """
    period = period_of(u)
    if period is None or y.size < 3 * period:
        return None
    whole = y[y.size % period :].reshape(-1, period)[1:]
    differences = np.diff(whole, axis=0)
    differences = differences - differences.mean(axis=1, keepdims=True)
    return float(np.mean(differences**2)) / 2.0
