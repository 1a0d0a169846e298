"""Noise floor: the explainable part of a residual, and the noise variance from repeated periods."""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from islands.diagnosis.inference.noise_surrogates import (
    Randomisation,
    draw_surrogates,
    list_noise_models,
)
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.effects.interface.context import Signal
from islands.kernels.linear_filter import filter_linearly
from islands.kernels.memory_operators import play_from
from islands.records.noise_model import fit_noise
from islands.records.segments import count_runs, delay_samples, find_bounds, take_backward_differences

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

#: Fraction of the residual's mean square that regression does not predict by chance in white noise.
MIN_FRACTION = 0.05

#: Number of surrogates that a prediction of coloured noise is compared with.
SURROGATES = 39

#: Minimum length of a period, in samples.
MIN_PERIOD = 16

#: Largest accepted difference between two periods, in standard deviations of the input.
PERIOD_TOLERANCE = 1e-3

#: The same for lags that are examined, since the rounding of sums of squares is larger.
CANDIDATE_TOLERANCE = 0.1


def explainable_variance(
    residual: Signal,
    u: Signal,
    simulated: Signal,
    rng: np.random.Generator,
    segments: Sequence[int] = (),
) -> float:
    """Return the part of the residual's mean square that cross-validated ridge regression predicts.

    As `explain_residual`.
    """
    return explain_residual(residual, u, simulated, rng, segments)[0]


def explain_residual(
    residual: Signal,
    u: Signal,
    simulated: Signal,
    rng: np.random.Generator,
    segments: Sequence[int] = (),
) -> tuple[float, Signal]:
    """Explain a residual by cross-validated ridge regression.

    The features are lags, rates, low-pass filters, plays and random cosines of the input and the simulated
    output. Features do not reach across the boundary of two recordings; folds, which are contiguous
    blocks, may contain one. If a surrogate of the residual is predicted as well, by chance, nothing is
    explained. A mean that slow noise has by chance is subtracted first.

    Parameters
    ----------
    residual, u, simulated : ndarray, shape (samples,)
        Signals over the same samples; missing residuals are NaN and do not count.
    rng : Generator
        Draws the random features.
    segments : sequence of int
        Lengths of the recordings in samples.

    Returns
    -------
    float
        The part of the residual's mean square that is explained.
    ndarray, shape (known samples,)
        What is left of the residual.
    """
    is_known = ~np.isnan(residual)
    runs = count_runs(is_known, segments)
    raw = _make_features(u, simulated, segments)[is_known]
    residual = _subtract_chance_mean(residual[is_known], runs)
    designs = _make_designs(raw, rng)
    total = best = float(np.sum(residual[:, None] ** 2, axis=0)[0])
    left = residual
    for errors in _cross_validate(designs, residual[:, None]):
        squares = float(_sum_squares(errors)[0])
        if squares < best:
            best, left = squares, np.concatenate(errors)[:, 0]
    explained = (total - best) / residual.size
    if explained <= MIN_FRACTION * float(np.mean(residual**2)):
        return explained, left
    noise = list_noise_models(residual, runs)[0]
    drawn = draw_surrogates(residual, noise, runs, Randomisation.PHASES, SURROGATES, rng.spawn(1)[0])
    surrogates = np.column_stack(list(drawn))
    by_chance = _predict_mean_square(designs, surrogates) / np.mean(surrogates**2, axis=0)
    is_by_chance = explained <= float(np.max(by_chance)) * float(np.mean(residual**2))
    return (0.0, residual) if is_by_chance else (explained, left)


def _subtract_chance_mean(residual: Signal, segments: Sequence[int]) -> Signal:
    """Return a residual without its mean, unless an offset would have a sufficient gain as an effect.

    The constant of the regression predicts the mean of slow noise in all folds. Surrogates have none, since
    their innovations are centred.
    """
    centred = residual - residual.mean()
    costs = [fit_noise(each, segments=segments).minus_twice_log_likelihood for each in (residual, centred)]
    return residual if costs[0] - costs[1] - np.log(residual.size) > MIN_GAIN else centred


def _make_designs(raw: Signal, rng: np.random.Generator) -> list[Signal]:
    """Return the features of all samples, once for each frequency scale of the random cosines."""
    raw = (raw - raw.mean(axis=0)) / (raw.std(axis=0) + 1e-12)
    left, singular_values, _ = np.linalg.svd(raw, full_matrices=False)
    axes = left[:, singular_values > 1e-6 * singular_values[0]] * np.sqrt(len(raw))
    designs = []
    for scale in FREQUENCY_SCALES:
        frequencies = (
            rng.standard_normal((axes.shape[1], RANDOM_FEATURES)) * 2 * scale / np.sqrt(axes.shape[1])
        )
        cosines = np.cos(axes @ frequencies + rng.uniform(0.0, 2 * np.pi, RANDOM_FEATURES))
        designs.append(np.column_stack([np.ones(len(axes)), axes, cosines]))
    return designs


def _predict_mean_square(designs: Sequence[Signal], residuals: Signal) -> Signal:
    """Return the part of each residual's mean square that the best of all regressions predicts.

    Parameters
    ----------
    designs : sequence of ndarray, each of shape (samples, features)
    residuals : ndarray, shape (samples, residuals)

    Returns
    -------
    ndarray, shape (residuals,)
    """
    total = np.sum(residuals**2, axis=0)
    best = total
    for errors in _cross_validate(designs, residuals):
        best = np.minimum(best, _sum_squares(errors))
    return (total - best) / len(residuals)


def _sum_squares(errors: Sequence[Signal]) -> Signal:
    """Return the sum of squares of each residual's errors in all folds, shape (residuals,)."""
    squares = np.zeros(errors[0].shape[1])
    for each in errors:
        squares += np.sum(each**2, axis=0)
    return squares


def _cross_validate(designs: Sequence[Signal], residuals: Signal) -> Iterator[list[Signal]]:
    """Yield the errors of each regression in its folds, each of shape (samples of the fold, residuals)."""
    samples = len(residuals)
    fold = np.arange(samples) * FOLDS // samples
    for design in designs:
        grams = [design[fold == each].T @ design[fold == each] for each in range(FOLDS)]
        moments = [design[fold == each].T @ residuals[fold == each] for each in range(FOLDS)]
        for ridge in RIDGES:
            errors = []
            for each in range(FOLDS):
                gram = sum(grams) - grams[each] + ridge * samples * np.eye(design.shape[1])
                weights = scipy.linalg.solve(gram, sum(moments) - moments[each], assume_a="pos")
                errors.append((residuals - design @ weights)[fold == each])
            yield errors


def _make_features(u: Signal, simulated: Signal, segments: Sequence[int]) -> Signal:
    features = [_make_features_of_signal(signal, segments) for signal in (u, simulated)]
    return np.column_stack(features)


def _make_features_of_signal(signal: Signal, segments: Sequence[int]) -> Signal:
    parts = [signal[first:last] for first, last in find_bounds(segments, signal.size)]
    rates = [take_backward_differences(part) for part in parts]
    rate_scale = 0.1 * float(np.std(np.concatenate(rates))) + 1e-12
    widths = [width * float(np.std(signal)) for width in PLAY_WIDTHS]
    return np.concatenate(
        [
            np.column_stack(_make_columns(part, rate, rate_scale, widths))
            for part, rate in zip(parts, rates, strict=True)
        ]
    )


def _make_columns(signal: Signal, rate: Signal, rate_scale: float, widths: Sequence[float]) -> list[Signal]:
    """Return the features of one signal in one recording."""
    decays = [np.exp(-1.0 / time_constant) for time_constant in TIME_CONSTANTS]
    return [
        *(signal, rate, np.tanh(rate / rate_scale)),
        *(delay_samples(signal, lag) for lag in LAGS),
        *(filter_linearly([1.0 - a], [1.0, -a], signal - signal[0]) for a in decays),
        *(play_from(signal, width) for width in widths),
    ]


def detect_period(u: Signal) -> int | None:
    """Return the period of an input in samples; None if it is not periodic or has fewer than two periods."""
    n = u.size
    centred = u - u.mean()
    std = float(np.std(u))
    lags = np.arange(n // 2 + 1)
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n)) ** 2)[: lags.size]
    # The sum of (u[k + lag] - u[k])^2: the squares of all but the last and all but the first samples.
    energy = np.concatenate([[0.0], np.cumsum(centred**2)])
    differences = (energy[n - lags] + energy[n] - energy[lags] - 2.0 * products) / (n - lags)
    for lag in np.flatnonzero(differences < (CANDIDATE_TOLERANCE * std) ** 2):
        if lag < MIN_PERIOD:
            continue
        if float(np.std(u[lag:] - u[:-lag])) < PERIOD_TOLERANCE * std:
            return int(lag)
    return None


def noise_variance_from_periods(u: Signal, y: Signal, segments: Sequence[int] = ()) -> float | None:
    """Return the variance of the output noise from repeated periods; None if there are fewer than three.

    Periods are looked for in each recording; recordings without three of them do not count. The first period
    is left out, since transients decay in it. The mean difference of two periods is drift and does not count
    as noise.

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
        Missing outputs are NaN.
    segments : sequence of int
        Lengths of the recordings in samples.
    """
    found = [_subtract_periods(u[first:last], y[first:last]) for first, last in find_bounds(segments, y.size)]
    differences = [each.ravel() for each in found if each is not None]
    squares = np.concatenate(differences) ** 2 if differences else np.zeros(0)
    squares = squares[~np.isnan(squares)]
    return float(np.mean(squares)) / 2.0 if squares.size else None


def contrast_periods(u: Signal, y: Signal) -> Signal | None:
    """Return orthonormal contrasts of the periods of an output without gaps; None without three periods.

    Contrasts are noise, since a simulation and every effect of the input repeat. Their variance is that of
    the noise (Pintelon and Schoukens, System Identification, 2012, section 2.5). The first period is left
    out, since transients decay in it. Noise at multiples of the frequency of the periods is not in them.

    Returns
    -------
    ndarray, shape (periods - 1, samples of a period)
        The periods are those after the first one.
    """
    periods = split_periods(u, y)
    return None if periods is None else np.array(scipy.linalg.helmert(len(periods)) @ periods)


def _subtract_periods(u: Signal, y: Signal) -> Signal | None:
    """Return the differences of successive periods of the output, or None if there are fewer than three."""
    periods = split_periods(u, y)
    if periods is None:
        return None
    differences = np.diff(periods, axis=0)
    differences = differences[~np.isnan(differences).all(axis=1)]
    is_gap = np.isnan(differences)
    if is_gap.any():
        return np.array(differences - np.nanmean(differences, axis=1, keepdims=True))
    return np.array(differences - differences.mean(axis=1, keepdims=True))


def split_periods(u: Signal, y: Signal) -> Signal | None:
    """Return the periods of an output after the first one, or None if there are fewer than three."""
    period = detect_period(u)
    if period is None or y.size < 3 * period:
        return None
    return y[y.size % period :].reshape(-1, period)[1:]
