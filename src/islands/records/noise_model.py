"""Noise model: fractionally integrated autoregressive noise, with its orders selected by BIC."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import attrgetter

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.records.segments import Signal, find_bounds, map_segments

#: Maximum order of the autoregression.
MAX_ORDER = 16

#: Maximum order of the autoregression that whitens residuals in an estimation.
WHITENING_ORDER = 3

#: Orders of the fractional difference that are tried. Noise with a spectrum of 1/f has the order 0.5.
DIFFERENCE_ORDERS = (0.25, 0.5, 0.75)

#: Least order of the autoregression without a difference for which differences are tried. Noise with long
#: memory needs several time constants, and first-order noise includes the random walk.
MIN_LONG_MEMORY_ORDER = 2


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """Fractionally integrated autoregression: ``d(k) = a1 d(k-1) + ... + e(k)``, ``d = (1 - q^-1)^D r``.

    The spectrum of the residual r falls with the power 2 D of the frequency, down to the lowest one (Granger
    and Joyeux, 1980).

    Attributes
    ----------
    coefficients : ndarray, shape (order of the autoregression,)
    variance : float
        Variance of the innovations ``e``.
    effective_samples : float
        Effective sample size of the residual.
    difference_order : float
        Order D of the fractional difference; 0 for noise without long memory.
    """

    coefficients: Signal
    variance: float
    effective_samples: float
    difference_order: float = 0.0

    @property
    def order(self) -> int:
        """Number of values that describe the colour of the noise; 0 for white noise."""
        return int(self.coefficients.size) + (self.difference_order != 0.0)

    @property
    def minus_twice_log_likelihood(self) -> float:
        """Minus twice the log-likelihood plus the BIC penalty on the order, up to an additive constant."""
        return self.effective_samples * float(np.log(self.variance)) + self.order * float(
            np.log(self.effective_samples)
        )

    @property
    def largest_pole(self) -> float:
        """Largest magnitude of the poles of the autoregression; 0 without one."""
        poles = np.roots(self._polynomial)
        return float(np.max(np.abs(poles), initial=0.0))

    @property
    def _polynomial(self) -> Signal:
        return np.concatenate([[1.0], -self.coefficients])

    def whiten(self, signal: Signal, segments: Sequence[int] = ()) -> Signal:
        """Filter a signal with the inverse of the noise model; the filter starts at rest in every segment."""
        if self.order == 0:
            return signal

        def whiten_segment(part: Signal) -> Signal:
            part = take_fractional_difference(part, self.difference_order)
            filtered = part.copy()
            for lag, coefficient in enumerate(self.coefficients[: part.size - 1], start=1):
                filtered[lag:] -= coefficient * part[:-lag]
            return filtered

        return map_segments(whiten_segment, signal, segments)

    def colour(self, innovations: Signal) -> Signal:
        """Filter innovations with the noise model, which starts at rest; the inverse of `whiten`."""
        # The inspection of a record, which whitens only, does not load the kernels.
        from islands.kernels.linear_filter import filter_linearly  # noqa: PLC0415

        filtered = filter_linearly([1.0], self._polynomial, innovations)
        return take_fractional_difference(filtered, -self.difference_order)

    def limit_poles(self, time_constant: float) -> "NoiseModel":
        """Return the model with time constants of at most ``time_constant`` samples.

        A model that was fitted to a drift may have a pole on or outside the unit circle.
        """
        largest_pole, limit = self.largest_pole, 1.0 - 1.0 / time_constant
        if largest_pole <= limit:
            return self
        factors = (limit / largest_pole) ** np.arange(1, self.coefficients.size + 1)
        return replace(self, coefficients=self.coefficients * factors)


def fit_noise(
    residual: Signal,
    max_order: int = MAX_ORDER,
    segments: Sequence[int] = (),
    difference_orders: Sequence[float] = DIFFERENCE_ORDERS,
) -> NoiseModel:
    """Fit a noise model by least squares and select its orders by BIC.

    Parameters
    ----------
    residual : ndarray, shape (samples,)
        Residual without gaps. NaN of a diverged simulation gives white noise of infinite variance.
    max_order : int
        Maximum order of the autoregression.
    segments : sequence of int
        Lengths of the recordings in samples; no equation reaches from one into the next.
    difference_orders : sequence of float
        Orders of the fractional difference that are tried.
    """
    if np.isnan(residual).any():  # the simulation has diverged
        return NoiseModel(np.zeros(0), float("inf"), residual.size)
    best = _fit_autoregression(residual, 0.0, max_order, segments)
    if best.order >= MIN_LONG_MEMORY_ORDER:
        for difference_order in difference_orders:
            candidate = _fit_autoregression(residual, difference_order, max_order, segments)
            if candidate.minus_twice_log_likelihood < best.minus_twice_log_likelihood:
                best = candidate
    return best


def fit_integrated_noise(residual: Signal, segments: Sequence[int] = ()) -> NoiseModel:
    """Fit a noise model to the differences of a residual: a random walk, filtered by an autoregression."""
    return _fit_autoregression(residual, 1.0, MAX_ORDER, segments)


def fit_whitening(residual: Signal, segments: Sequence[int] = ()) -> NoiseModel:
    """Fit the noise model that whitens residuals in an estimation: an autoregression of low order.

    The model of `fit_noise` decides between hypotheses. As a filter it can reduce the response to a jump to a
    few samples, and then a calibration does not find its instant.
    """
    return fit_noise(residual, WHITENING_ORDER, segments, ())


def _fit_autoregression(
    residual: Signal, difference_order: float, max_order: int, segments: Sequence[int]
) -> NoiseModel:
    """Fit an autoregression to a fractional difference of the residual."""
    n = residual.size
    difference = map_segments(
        lambda part: take_fractional_difference(part, difference_order), residual, segments
    )
    # All orders use the same equations, so that the inner products of all lags are computed once.
    lengths = [last - first for first, last in find_bounds(segments, n)]
    if sum(max(length - max_order, 0) for length in lengths) < n // 2:  # gaps leave short segments
        max_order = min(max_order, WHITENING_ORDER)
    bounds = [(first, last) for first, last in find_bounds(segments, n) if last - first > max_order]
    if not bounds:  # gaps leave no equation
        return white_noise(float(np.mean(residual**2)), n)
    later = np.concatenate([difference[first + max_order : last] for first, last in bounds])
    # A copy of windows is eight times as fast as a stack of columns.
    lagged = np.concatenate(
        [sliding_window_view(difference[first : last - 1], max_order)[:, ::-1] for first, last in bounds]
    )
    gram, moment, energy = lagged.T @ lagged, lagged.T @ later, float(later @ later)

    def fit(order: int) -> NoiseModel:
        coefficients = np.asarray(np.linalg.lstsq(gram[:order, :order], moment[:order], rcond=None)[0])
        variance = max((energy - float(coefficients @ moment[:order])) / later.size, np.finfo(float).tiny)
        return NoiseModel(coefficients, variance, n, difference_order)

    try:
        # The leading blocks of one factor belong to the lower orders.
        explained = np.linalg.solve(np.linalg.cholesky(gram), moment) ** 2
    except np.linalg.LinAlgError:  # lagged residuals are linearly dependent
        return min(map(fit, range(max_order + 1)), key=attrgetter("minus_twice_log_likelihood"))
    variances = np.maximum(energy - np.append(0.0, np.cumsum(explained)), np.finfo(float).tiny)
    costs = n * np.log(variances) + np.log(n) * np.arange(max_order + 1)
    return fit(int(np.argmin(costs)))


def take_fractional_difference(signal: Signal, order: float) -> Signal:
    """Return ``(1 - q^-1)^order`` times a signal that is zero before its first sample."""
    if order == 0.0:
        return signal
    import scipy  # noqa: PLC0415 - the inspection of a record does not load it

    size = scipy.fft.next_fast_len(2 * signal.size - 1, real=True)
    spectrum = scipy.fft.rfft(signal, size) * _transform_weights(order, signal.size)
    return np.array(scipy.fft.irfft(spectrum, size)[: signal.size])


@lru_cache(maxsize=16)
def _transform_weights(order: float, count: int) -> NDArray[np.complex128]:
    """Return the transform of the impulse response of the difference (Hosking, 1981, equation 2)."""
    import scipy  # noqa: PLC0415 - as above

    lags = np.arange(1, count)
    weights = np.concatenate([[1.0], np.cumprod((lags - 1 - order) / lags)])
    return np.asarray(scipy.fft.rfft(weights, scipy.fft.next_fast_len(2 * count - 1, real=True)))


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


def is_rounding_error(residual: Signal, y: Signal) -> bool:
    """Return whether a residual is rounding: the measured output is that of the simulation.

    Parameters
    ----------
    residual, y : ndarray, shape (samples,)
        Missing samples are NaN.
    """
    return float(np.nanmean(residual**2)) <= float(np.finfo(float).eps * np.nanmax(np.abs(y))) ** 2
