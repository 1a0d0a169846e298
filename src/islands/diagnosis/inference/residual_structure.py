"""Residual analysis: dependence of a residual on the input, its rate and acceleration, and the output."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Signal, SimulationContext
from islands.records.noise_model import fit_noise
from islands.records.segments import count_runs, map_segments, take_backward_differences

#: Number of random circular shifts that give the null distribution of a map.
SHIFTS = 200

#: Distance from the null distribution above which a dependence is significant, in standard deviations.
MIN_DISTANCE = 4.5


def find_residual_structure(
    residual: Signal, simulated: Signal, context: SimulationContext, rng: np.random.Generator
) -> Mapping[str, float]:
    """Return the maps on which a residual depends, each with its distance in standard deviations.

    The whitened residual is averaged over cells of the input, its rate, direction and acceleration, and the
    output. The null distribution comes from circular shifts of the residual, which keep its autocorrelation
    and remove its dependence on the maps. A shift moves the end of a recording into another one, which
    changes the autocorrelation of few samples.

    Parameters
    ----------
    residual, simulated : ndarray, shape (samples,)
        Signals over the estimation part; missing residuals are NaN and do not count.
    """
    segments, is_known = context.segments, ~np.isnan(residual)
    maps = _make_maps(context.u[: residual.size], simulated, context.dt, segments)
    residual, runs = residual[is_known], count_runs(is_known, segments)
    n = residual.size
    whitened = fit_noise(residual, segments=runs).whiten(residual, runs)
    whitened = whitened - whitened.mean()
    if not whitened.any():
        return {}
    shifts = rng.integers(n // 20, n - n // 20, SHIFTS)
    distances = {}
    for name, all_cells in maps.items():
        cells = all_cells[is_known]
        if cells.min() == cells.max():  # a signal at rest
            continue
        null = np.log([_explained_squares(np.roll(whitened, shift), cells) for shift in shifts])
        distance = (float(np.log(_explained_squares(whitened, cells))) - float(null.mean())) / float(
            null.std()
        )
        if distance > MIN_DISTANCE:
            distances[name] = distance
    return distances


def _explained_squares(signal: Signal, cells: NDArray[np.int64]) -> float:
    """Return the sum of squares that the means of the cells explain."""
    sums, counts = np.bincount(cells, weights=signal), np.bincount(cells)
    return float(np.sum(sums**2 / np.maximum(counts, 1)))


def _make_maps(u: Signal, y: Signal, dt: float, segments: Sequence[int]) -> Mapping[str, NDArray[np.int64]]:
    """Return the cell index of every sample, by name of the map."""
    rate = map_segments(take_backward_differences, u, segments) / dt
    acceleration = map_segments(take_backward_differences, rate, segments) / dt
    direction = (rate > 0.0).astype(np.int64)
    return {
        "input": _assign_cells(u, 24),
        "rate": _assign_cells(rate, 24),
        "output": _assign_cells(y, 32),
        "acceleration": _assign_cells(acceleration, 24),
        "input and direction": 2 * _assign_cells(u, 16) + direction,
        "input and rate": 8 * _assign_cells(u, 8) + _assign_cells(rate, 8),
        "output and direction": 2 * _assign_cells(y, 16) + direction,
        "output and acceleration": 8 * _assign_cells(y, 8) + _assign_cells(acceleration, 8),
    }


def _assign_cells(signal: Signal, count: int) -> NDArray[np.int64]:
    """Return the cell index of every sample; the cells hold about equally many samples."""
    edges = np.quantile(signal, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, signal).astype(np.int64)
