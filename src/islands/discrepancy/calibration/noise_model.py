"""Noise that remembers: an autoregression of what is left, its order by BIC, and what that leaves."""

from dataclasses import dataclass

import numpy as np
import scipy

from islands.discrepancy.interfaces.effect import Signal

#: The highest order that is tried.
HIGHEST = 3


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """An autoregression ``r(k) = a1 r(k-1) + ... + e(k)``.

    Attributes
    ----------
    coefficients : ndarray, shape (order,)
    variance : float
        Of ``e``.
    effective_samples : float
        Of the residual, as many as know nothing of each other.
    """

    coefficients: Signal
    variance: float
    effective_samples: float

    @property
    def order(self) -> int:
        """How far it remembers."""
        return int(self.coefficients.size)

    @property
    def minus_twice_log_likelihood(self) -> float:
        """Its fit, punished for its order as BIC does; up to a constant of the record."""
        return self.effective_samples * float(np.log(self.variance)) + self.order * float(
            np.log(self.effective_samples)
        )

    def whiten(self, signal: Signal) -> Signal:
        """Take out of a signal what this noise remembers."""
        if self.order == 0:
            return signal
        whitened: Signal = scipy.signal.lfilter(np.concatenate([[1.0], -self.coefficients]), [1.0], signal)
        return whitened


def fit_ar_noise(residual: Signal, highest: int = HIGHEST) -> NoiseModel:
    """Fit an autoregression by least squares; the order is BIC's.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        Of one recording, without gaps.
    """
    found: NoiseModel | None = None
    n = residual.size
    if np.isnan(residual).any():  # of a simulation that explodes
        return NoiseModel(np.zeros(0), float("inf"), n)
    later = residual[highest:]
    # The same equations for every order: all lags' inner products at once.
    lagged = np.column_stack([residual[highest - lag : n - lag] for lag in range(1, highest + 1)])
    gram, moment, energy = lagged.T @ lagged, lagged.T @ later, float(later @ later)
    for order in range(highest + 1):
        coefficients: Signal = np.zeros(0)
        left = energy
        if order:
            coefficients = np.asarray(np.linalg.lstsq(gram[:order, :order], moment[:order], rcond=None)[0])
            left = energy - float(coefficients @ moment[:order])
        variance = max(left / later.size, np.finfo(float).tiny)
        tried = NoiseModel(coefficients, variance, n)
        if found is None or tried.minus_twice_log_likelihood < found.minus_twice_log_likelihood:
            found = tried
    assert found is not None
    return found


def white_noise(mean_square: float, samples: float) -> NoiseModel:
    """Return noise that does not remember."""
    return NoiseModel(np.zeros(0), max(mean_square, np.finfo(float).tiny), samples)


def effective_samples(residual: Signal) -> float:
    """Return how many samples that know nothing of each other a residual is worth: n over the sum of rho^2.

    Bartlett's: the variance of a mean square, of a stationary normal residual.
    """
    n = residual.size
    centred = residual - residual.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[: n // 4]
    rho = correlation / max(float(correlation[0]), np.finfo(float).tiny)
    return max(10.0, n / (1.0 + 2.0 * float(np.sum(rho[1:] ** 2))))
