"""Variance model: noise whose size depends on the output or changes over the record."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Signal
from islands.rounding import NORMAL_MEDIAN

#: Candidate strengths k, times the largest absolute output.
STRENGTHS = np.concatenate([[0.0], np.geomspace(0.1, 30.0, 60)])

#: Number of parts of the record in each of which the size of the noise is constant.
PARTS = 12

#: Innovations count at most as this number of robust standard deviations: outliers are no change of variance.
CLIP = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class VarianceModel:
    """Standard deviation of noise, ``sigma l(t) (1 + k |y|)``.

    Attributes
    ----------
    strength : float
        k times the largest absolute output; 0 if the noise does not depend on the output.
    strength_gain, levels_gain : float
        Decreases of minus twice the log-likelihood by k and by l, less their BIC penalties; 0 without them.
    levels : ndarray, shape (parts,)
        Size l of the noise in parts of equal length; ones if it does not change.
    scale : ndarray, shape (samples,)
        Standard deviation of each sample divided by sigma.
    """

    strength: float
    strength_gain: float
    levels: Signal
    levels_gain: float
    scale: Signal


def fit_variance_model(innovations: Signal, output: Signal) -> VarianceModel:
    """Fit the variance of innovations (Davidian and Carroll, Variance function estimation, 1987).

    Parameters
    ----------
    innovations, output : ndarray, shape (samples,)
        Whitened residual, and the simulated output at the same samples. The measured output contains the
        noise, so that large values of one are large values of the other.
    """
    n = innovations.size
    size = np.abs(output) / max(float(np.max(np.abs(output))), np.finfo(float).tiny)
    strength, strength_gain = _fit_strength(innovations, size)
    scale = 1.0 + strength * size
    part = np.arange(n) * PARTS // n
    levels, levels_gain = _fit_levels(innovations / scale, part)
    return VarianceModel(strength, strength_gain, levels, levels_gain, scale * levels[part])


def _fit_strength(innovations: Signal, size: Signal) -> tuple[float, float]:
    n = innovations.size
    robust = float(np.median(np.abs(innovations))) / NORMAL_MEDIAN
    if robust == 0.0:  # most of the residual is exactly zero
        return 0.0, 0.0
    squares = np.minimum(innovations**2, (CLIP * robust * (1.0 + size)) ** 2)
    costs = [
        n * float(np.log(np.mean(squares / (1.0 + k * size) ** 2))) + 2 * float(np.sum(np.log1p(k * size)))
        for k in STRENGTHS
    ]
    best = int(np.argmin(costs))
    standardised = squares / (1.0 + STRENGTHS[best] * size) ** 2
    gain = (costs[0] - costs[best]) / _inflation(standardised) - float(np.log(n))
    return (float(STRENGTHS[best]), gain) if gain > 0.0 else (0.0, 0.0)


def _fit_levels(innovations: Signal, part: NDArray[np.int64]) -> tuple[Signal, float]:
    constant = np.ones(PARTS)
    squares = np.empty(innovations.size)
    for index in range(PARTS):
        own = np.abs(innovations[part == index])
        robust = float(np.median(own)) / NORMAL_MEDIAN if own.size else 0.0
        if robust == 0.0:
            return constant, 0.0
        squares[part == index] = np.minimum(own, CLIP * robust) ** 2
    counts = np.bincount(part, minlength=PARTS)
    means = np.bincount(part, weights=squares, minlength=PARTS) / counts
    together = float(np.mean(squares))
    decrease = float(np.sum(counts * np.log(together / means)))
    gain = decrease / _inflation(squares / means[part]) - (PARTS - 1) * float(np.log(innovations.size))
    return (np.sqrt(means / together), gain) if gain > 0.0 else (constant, 0.0)


def _inflation(squares: Signal) -> float:
    """Return the factor by which heavy tails inflate a likelihood ratio of variances; 1 for normal noise."""
    kurtosis = float(np.mean(squares**2) / np.mean(squares) ** 2)
    return max((kurtosis - 1.0) / 2.0, 1.0)
