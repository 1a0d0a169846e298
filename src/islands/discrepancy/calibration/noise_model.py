"""Autoregressive noise model, with its order selected by BIC."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Signal
from islands.discrepancy.interfaces.segments import find_bounds, map_segments

#: Maximum order of the autoregression.
MAX_ORDER = 3


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """An autoregression ``r(k) = a1 r(k-1) + ... + e(k)``.

    Attributes
    ----------
    coefficients : ndarray, shape (order,)
    variance : float
        Variance of the innovations ``e``.
    effective_samples : float
        Effective sample size of the residual.
    """

    coefficients: Signal
    variance: float
    effective_samples: float

    @property
    def order(self) -> int:
        """Order of the autoregression; 0 for white noise."""
        return int(self.coefficients.size)

    @property
    def minus_twice_log_likelihood(self) -> float:
        """Minus twice the log-likelihood plus the BIC penalty on the order, up to an additive constant."""
        return self.effective_samples * float(np.log(self.variance)) + self.order * float(
            np.log(self.effective_samples)
        )

    def whiten(self, signal: Signal, segments: Sequence[int] = ()) -> Signal:
        """Filter a signal with the inverse of the noise model; the filter starts at rest in every segment."""
        if self.order == 0:
            return signal
        inverse = np.concatenate([[1.0], -self.coefficients])
        return map_segments(lambda part: scipy.signal.lfilter(inverse, [1.0], part), signal, segments)


def fit_ar_noise(residual: Signal, max_order: int = MAX_ORDER, segments: Sequence[int] = ()) -> NoiseModel:
    """Fit an autoregression by least squares and select its order by BIC.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        Residual without gaps. NaN of a diverged simulation gives white noise of infinite variance.
    max_order : int
        Maximum order of the autoregression.
    segments : sequence of int
        Lengths of the recordings in samples; no equation reaches from one into the next.
    """
    best: NoiseModel | None = None
    n = residual.size
    if np.isnan(residual).any():  # the simulation has diverged
        return NoiseModel(np.zeros(0), float("inf"), n)
    # All orders use the same equations, so that the inner products of all lags are computed once.
    bounds = [(first, last) for first, last in find_bounds(segments, n) if last - first > max_order]
    if not bounds:  # gaps leave no equation
        return white_noise(float(np.mean(residual**2)), n)
    later = np.concatenate([residual[first + max_order : last] for first, last in bounds])
    lagged = np.column_stack(
        [
            np.concatenate([residual[first + max_order - lag : last - lag] for first, last in bounds])
            for lag in range(1, max_order + 1)
        ]
    )
    gram, moment, energy = lagged.T @ lagged, lagged.T @ later, float(later @ later)
    for order in range(max_order + 1):
        coefficients: Signal = np.zeros(0)
        remaining = energy
        if order:
            coefficients = np.asarray(np.linalg.lstsq(gram[:order, :order], moment[:order], rcond=None)[0])
            remaining = energy - float(coefficients @ moment[:order])
        variance = max(remaining / later.size, np.finfo(float).tiny)
        candidate = NoiseModel(coefficients, variance, n)
        if best is None or candidate.minus_twice_log_likelihood < best.minus_twice_log_likelihood:
            best = candidate
    assert best is not None
    return best


def white_noise(mean_square: float, samples: float) -> NoiseModel:
    """Return a model of white noise, given its mean square and the effective sample size."""
    return NoiseModel(np.zeros(0), max(mean_square, np.finfo(float).tiny), samples)


def estimate_effective_samples(residual: Signal, segments: Sequence[int] = ()) -> float:
    """Estimate the effective sample size of a residual: n over the sum of rho^2, and at least 10.

    Bartlett's formula for the variance of the mean square of a stationary normal residual. Products of
    samples of different recordings are left out.
    """
    n = residual.size
    centred = residual - residual.mean()
    parts = [centred[first:last] for first, last in find_bounds(segments, n)]
    spectrum = sum(np.abs(np.fft.rfft(part, 2 * n)) ** 2 for part in parts)
    correlation = np.fft.irfft(spectrum)[: n // 4]
    rho = correlation / max(float(correlation[0]), np.finfo(float).tiny)
    return max(10.0, n / (1.0 + 2.0 * float(np.sum(rho[1:] ** 2))))
