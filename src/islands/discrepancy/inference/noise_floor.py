"""Noise floor: the explainable part of a residual, and the noise variance from repeated periods."""

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Signal
from islands.systems.hysteresis_operators import play_from

#: Lags of the features, in samples.
LAGS = (1, 2, 4, 8, 16, 32)

#: Time constants of the first-order low-pass features, in samples.
TIME_CONSTANTS = (5.0, 20.0, 80.0, 320.0)

#: Widths of the play operators, in standard deviations of the signal.
PLAY_WIDTHS = (0.1, 0.4, 1.2)

#: Number of random cosine features.
RANDOM_FEATURES = 200

#: Frequency scales of the random features.
FREQUENCY_SCALES = (0.15, 0.5)

#: Number of folds of the cross-validation.
FOLDS = 6

#: Ridge parameters.
RIDGES = (1e-4, 1e-2, 1.0)

#: Minimum length of a period, in samples.
MIN_PERIOD = 16

#: Largest accepted difference between two periods, in standard deviations of the input.
PERIOD_TOLERANCE = 1e-3


def explainable_variance(residual: Signal, u: Signal, simulated: Signal, rng: np.random.Generator) -> float:
    """Return the part of the residual's mean square that cross-validated ridge regression predicts.

    The features are lags, rates, low-pass filters, plays and random cosines of the input and the simulated
    output. Folds are contiguous blocks.

    Parameters
    ----------
    residual, u, simulated : ndarray, shape (samples,)
        Signals over the same samples, without gaps.
    rng : Generator
        Draws the random features.
    """
    raw = _make_features(u, simulated)
    raw = (raw - raw.mean(axis=0)) / (raw.std(axis=0) + 1e-12)
    left, singular_values, _ = np.linalg.svd(raw, full_matrices=False)
    axes = left[:, singular_values > 1e-6 * singular_values[0]] * np.sqrt(len(raw))
    fold = np.arange(residual.size) * FOLDS // residual.size
    total = float(residual @ residual)
    best = total
    for scale in FREQUENCY_SCALES:
        frequencies = (
            rng.standard_normal((axes.shape[1], RANDOM_FEATURES)) * 2 * scale / np.sqrt(axes.shape[1])
        )
        cosines = np.cos(axes @ frequencies + rng.uniform(0.0, 2 * np.pi, RANDOM_FEATURES))
        design = np.column_stack([np.ones(len(axes)), axes, cosines])
        grams = [design[fold == each].T @ design[fold == each] for each in range(FOLDS)]
        moments = [design[fold == each].T @ residual[fold == each] for each in range(FOLDS)]
        for ridge in RIDGES:
            squared_error = 0.0
            for each in range(FOLDS):
                gram = sum(grams) - grams[each] + ridge * residual.size * np.eye(design.shape[1])
                weights = scipy.linalg.solve(gram, sum(moments) - moments[each], assume_a="pos")
                squared_error += float(np.sum((residual - design @ weights)[fold == each] ** 2))
            best = min(best, squared_error)
    return (total - best) / residual.size


def _make_features(u: Signal, simulated: Signal) -> Signal:
    columns = []
    for signal in (u, simulated):
        rate = np.gradient(signal)
        columns += [signal, rate, np.tanh(rate / (0.1 * np.std(rate) + 1e-12))]
        for lag in LAGS:
            columns.append(np.concatenate([np.full(lag, signal[0]), signal[:-lag]]))
        for time_constant in TIME_CONSTANTS:
            a = np.exp(-1.0 / time_constant)
            columns.append(scipy.signal.lfilter([1.0 - a], [1.0, -a], signal - signal[0]))
        for width in PLAY_WIDTHS:
            columns.append(play_from(signal, width * float(np.std(signal))))
    return np.column_stack(columns)


def detect_period(u: Signal) -> int | None:
    """Return the period of an input in samples; None if it is not periodic or has fewer than two periods."""
    n = u.size
    centred = u - u.mean()
    std = float(np.std(u))
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[: n // 2 + 1]
    correlation = products / (n - np.arange(products.size)) / max(std**2, np.finfo(float).tiny)
    for lag in np.flatnonzero(correlation > 0.9):
        if lag < MIN_PERIOD:
            continue
        if float(np.std(u[lag:] - u[:-lag])) < PERIOD_TOLERANCE * std:
            return int(lag)
    return None


def noise_variance_from_periods(u: Signal, y: Signal) -> float | None:
    """Return the variance of the output noise from repeated periods; None if there are fewer than three.

    The first period is left out, since transients decay in it. The mean difference of two periods is drift
    and does not count as noise.

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
    """
    period = detect_period(u)
    if period is None or y.size < 3 * period:
        return None
    periods = y[y.size % period :].reshape(-1, period)[1:]
    differences = np.diff(periods, axis=0)
    differences = differences - differences.mean(axis=1, keepdims=True)
    return float(np.mean(differences**2)) / 2.0
