"""What is left over: whether a residual still knows the input, the output, the rate or the time."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from islands.discrepancy.calibration.noise_model import fit_ar_noise
from islands.discrepancy.interfaces.effect import Signal, SimulationContext

#: Circular shifts that a map is compared with, and standard deviations beyond which it is no chance.
SHIFTS, FLAGGED = 200, 4.5


def describe_remainder(
    residual: Signal, simulated: Signal, context: SimulationContext, rng: np.random.Generator
) -> Mapping[str, float]:
    """Return maps in which a residual is no chance, each with its distance in standard deviations.

    The residual is averaged over cells of input, rate, direction and output, and so is the same residual
    shifted in time, which knows none of them: whatever stationary noise it is, it would do as well.

    Parameters
    ----------
    residual, simulated : ndarray, shape (samples,)
        Over the fitted samples, from the first on.
    """
    n = residual.size
    left = fit_ar_noise(residual).whiten(residual)
    left = left - left.mean()
    if not left.any():
        return {}
    shifts = rng.integers(n // 20, n - n // 20, SHIFTS)
    found = {}
    for name, cells in _maps(context.u[:n], simulated, context.dt).items():
        shifted = np.log([_explained(np.roll(left, shift), cells) for shift in shifts])
        distance = (float(np.log(_explained(left, cells))) - float(shifted.mean())) / float(shifted.std())
        if distance > FLAGGED:
            found[name] = distance
    return found


def _explained(signal: Signal, cells: NDArray[np.int64]) -> float:
    """Return the squares that the cells' means explain."""
    sums, counts = np.bincount(cells, weights=signal), np.bincount(cells)
    return float(np.sum(sums**2 / np.maximum(counts, 1)))


def _maps(u: Signal, y: Signal, dt: float) -> Mapping[str, NDArray[np.int64]]:
    rate = np.gradient(u, dt)
    bend = np.gradient(rate, dt)
    along = (rate > 0.0).astype(np.int64)
    return {
        "input": _cells(u, 24),
        "rate": _cells(rate, 24),
        "output": _cells(y, 32),
        "acceleration": _cells(bend, 24),
        "input and direction": 2 * _cells(u, 16) + along,
        "input and rate": 8 * _cells(u, 8) + _cells(rate, 8),
        "output and direction": 2 * _cells(y, 16) + along,
        "output and acceleration": 8 * _cells(y, 8) + _cells(bend, 8),
    }


def _cells(signal: Signal, count: int) -> NDArray[np.int64]:
    """Return the cell of every sample, cells being equally full."""
    edges = np.quantile(signal, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, signal).astype(np.int64)
