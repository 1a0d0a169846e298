"""A flexible reference: how much of a residual anything could explain that knows input and output."""

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Signal
from islands.systems.hysteresis_operators import play_from

#: Lags in samples, time constants of memories in samples, widths of plays in standard deviations.
LAGS, MEMORIES, PLAYS = (1, 2, 4, 8, 16, 32), (5.0, 20.0, 80.0, 320.0), (0.1, 0.4, 1.2)

#: Random waves, their steepness, folds of the cross-validation, and ridges that are tried.
WAVES, STEEPNESS, FOLDS, RIDGES = 200, (0.15, 0.5), 6, (1e-4, 1e-2, 1.0)


def explainable_variance(residual: Signal, u: Signal, simulated: Signal, rng: np.random.Generator) -> float:
    """Return the part of a residual's mean square that a flexible fit foretells on blocks left out.

    Ridge regression on lags, rates, slow memories, plays and random waves of input and simulated output.

    Parameters
    ----------
    residual, u, simulated : ndarray, shape (samples,)
        Over the same samples, without gaps.
    rng : Generator
        Draws the waves.
    """
    raw = _features(u, simulated)
    raw = (raw - raw.mean(axis=0)) / (raw.std(axis=0) + 1e-12)
    left, sizes, _ = np.linalg.svd(raw, full_matrices=False)
    axes = left[:, sizes > 1e-6 * sizes[0]] * np.sqrt(len(raw))
    fold = np.arange(residual.size) * FOLDS // residual.size
    total = float(residual @ residual)
    best = total
    for steepness in STEEPNESS:
        directions = rng.standard_normal((axes.shape[1], WAVES)) * 2 * steepness / np.sqrt(axes.shape[1])
        waves = np.cos(axes @ directions + rng.uniform(0.0, 2 * np.pi, WAVES))
        design = np.column_stack([np.ones(len(axes)), axes, waves])
        grams = [design[fold == each].T @ design[fold == each] for each in range(FOLDS)]
        moments = [design[fold == each].T @ residual[fold == each] for each in range(FOLDS)]
        for ridge in RIDGES:
            missed = 0.0
            for each in range(FOLDS):
                gram = sum(grams) - grams[each] + ridge * residual.size * np.eye(design.shape[1])
                weights = scipy.linalg.solve(gram, sum(moments) - moments[each], assume_a="pos")
                missed += float(np.sum((residual - design @ weights)[fold == each] ** 2))
            best = min(best, missed)
    return (total - best) / residual.size


def _features(u: Signal, simulated: Signal) -> Signal:
    columns = []
    for signal in (u, simulated):
        rate = np.gradient(signal)
        columns += [signal, rate, np.tanh(rate / (0.1 * np.std(rate) + 1e-12))]
        for lag in LAGS:
            columns.append(np.concatenate([np.full(lag, signal[0]), signal[:-lag]]))
        for memory in MEMORIES:
            a = np.exp(-1.0 / memory)
            columns.append(scipy.signal.lfilter([1.0 - a], [1.0, -a], signal - signal[0]))
        for width in PLAYS:
            columns.append(play_from(signal, width * float(np.std(signal))))
    return np.column_stack(columns)


#: The shortest period in samples, and what two of them may differ by, in standard deviations of the input.
SHORTEST, ALIKE = 16, 1e-3


def detect_period(u: Signal) -> int | None:
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


def noise_variance_from_periods(u: Signal, y: Signal) -> float | None:
    """Return the mean square of an output's noise from periods that repeat; None where none do.

    The first period is left out: whatever was before it dies away in it. What is level in the difference of
    two is drift, and no noise.

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
    """
    period = detect_period(u)
    if period is None or y.size < 3 * period:
        return None
    whole = y[y.size % period :].reshape(-1, period)[1:]
    differences = np.diff(whole, axis=0)
    differences = differences - differences.mean(axis=1, keepdims=True)
    return float(np.mean(differences**2)) / 2.0
