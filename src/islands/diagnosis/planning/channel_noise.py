"""Noise of a measured channel, and the whitening under which a plan compares signals."""

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import scipy

from islands.effects.interface.context import Signal
from islands.records.noise_model import NoiseModel, white_noise


class NoiseOrigin(StrEnum):
    """Where the noise of a plan comes from."""

    GIVEN = "given"
    PERIODS = "repeated periods"
    RESIDUAL = "residual"


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNoise:
    """Stationary noise of a channel.

    Whitened signals are in standard deviations of the innovations of the noise; for white noise, these are
    those of the noise. The sum of squares of a whitened signal r is the quadratic form ``r' C^-1 r`` with the
    covariance C of the noise.

    Attributes
    ----------
    model : NoiseModel
        A stable autoregression without a fractional difference, in the unit of the channel.
    origin : NoiseOrigin
    std : float
        Standard deviation of the noise, in the unit of the channel.
    """

    model: NoiseModel
    origin: NoiseOrigin
    std: float = field(init=False)
    _innovation_std: float = field(init=False)
    _start: Signal = field(init=False)

    def __post_init__(self) -> None:
        innovation_std = float(np.sqrt(self.model.variance))
        start = _whiten_start(self.model)
        std = 1.0 / float(start[0, 0]) if len(start) else innovation_std
        object.__setattr__(self, "std", std)
        object.__setattr__(self, "_innovation_std", innovation_std / std)
        object.__setattr__(self, "_start", start * std)

    @property
    def is_white(self) -> bool:
        """Whether the noise has no colour."""
        return self.model.order == 0

    @property
    def time_constant(self) -> float:
        """Largest time constant of the noise in samples; 0 for white noise."""
        return -1.0 / float(np.log(self.model.largest_pole)) if self.model.largest_pole else 0.0

    def scale(self, factor: float) -> "ChannelNoise":
        """Return noise of the same colour with a standard deviation that is larger by a factor."""
        return replace(self, model=replace(self.model, variance=factor**2 * self.model.variance))

    def whiten(self, signals: Signal) -> Signal:
        """Whiten signals in the unit of the channel.

        The first samples are predicted from those before them, as those of a stationary process.

        Parameters
        ----------
        signals : ndarray, shape (signals, samples)

        Returns
        -------
        ndarray, shape (signals, samples)
        """
        relative: Signal = signals / self.std
        if self.is_white:
            return relative
        whitened = np.stack([self.model.whiten(signal) for signal in relative]) / self._innovation_std
        order = len(self._start)
        whitened[:, :order] = relative[:, :order] @ self._start.T
        return whitened

    def colour(self, whitened: Signal) -> Signal:
        """Undo the whitening of one signal, and return it in standard deviations of the noise."""
        if self.is_white:
            return whitened
        order = len(self._start)
        first = scipy.linalg.solve_triangular(self._start, whitened[:order], lower=True, check_finite=False)
        innovations = self._innovation_std * whitened
        innovations[:order] = self.model.whiten(first)
        return self.model.colour(innovations)


def make_white_noise(std: float) -> ChannelNoise:
    """Return white noise of a given standard deviation."""
    return ChannelNoise(white_noise(std**2, np.inf), NoiseOrigin.GIVEN)


def _whiten_start(model: NoiseModel) -> Signal:
    """Return the matrix that whitens the first samples of an autoregression, shape (order, order).

    Each row predicts a sample from all before it. The predictors of lower orders follow from the
    autoregression by the step-down recursion (Kay, Modern Spectral Estimation, 1988, section 6.3).
    """
    coefficients, variance = model.coefficients, model.variance
    order = coefficients.size
    rows = np.zeros((order, order))
    for place in reversed(range(order)):
        reflection = coefficients[-1]
        coefficients = (coefficients[:-1] + reflection * coefficients[-2::-1]) / (1.0 - reflection**2)
        variance /= 1.0 - reflection**2
        rows[place, : place + 1] = np.append(-coefficients[::-1], 1.0) / np.sqrt(variance)
    return rows
