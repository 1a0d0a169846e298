"""Measurement noise of a trial, by kind."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import scipy

from lab.diagnosis.injection.excitation import Signal

#: Draws noise of about unit RMS, given the noise-free output: ``(rng, clean) -> noise``, shape (samples,).
DrawNoise = Callable[[np.random.Generator, Signal], Signal]

#: Samples that are discarded until a filter has reached its stationary state.
_WARM_UP = 1000

#: Length of the spectrum from which power-law noise is drawn, relative to the record. Longer periods than the
#: record make its ends independent.
_PERIOD = 4

#: Degrees of freedom of heavy-tailed noise.
_DEGREES_OF_FREEDOM = 3.0

#: Standard deviation of multiplicative noise where the output is zero, relative to that at its RMS value.
_ADDITIVE_FRACTION = 0.1

#: Ratio of the largest to the smallest standard deviation of non-stationary noise.
_VARIANCE_RANGE = 8.0


def _white(rng: np.random.Generator, clean: Signal) -> Signal:
    return rng.standard_normal(clean.size + _WARM_UP)[_WARM_UP:]


def _autoregressive(pole: float) -> DrawNoise:
    """Return first-order autoregressive noise."""

    def draw(rng: np.random.Generator, clean: Signal) -> Signal:
        white = rng.standard_normal(clean.size + _WARM_UP)
        coloured: Signal = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)
        return coloured[_WARM_UP:]

    return draw


def _arma(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw ARMA(2, 2) noise with random resonance and antiresonance."""
    poles, zeros = (
        np.poly(radius * np.exp([1j * angle, -1j * angle])).real
        for radius, angle in (
            (rng.uniform(0.8, 0.98), rng.uniform(0.0, 0.5)),
            (rng.uniform(0.4, 0.8), rng.uniform(0.3, 2.5)),
        )
    )
    coloured = scipy.signal.lfilter(zeros, poles, rng.standard_normal(clean.size + _WARM_UP))
    impulse = scipy.signal.lfilter(zeros, poles, np.eye(1, _WARM_UP)[0])
    return np.array(coloured[_WARM_UP:] / np.linalg.norm(impulse))


def _pink(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw noise with a power spectrum of 1/f down to a quarter of the record's lowest frequency."""
    count = _PERIOD * clean.size
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
    spectrum[0] = 0.0
    return _with_unit_rms(np.fft.irfft(spectrum, count)[: clean.size])


def _brown(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw a random walk that starts at zero."""
    return _with_unit_rms(np.cumsum(rng.standard_normal(clean.size)))


def _multiplicative(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw white noise whose standard deviation grows with the magnitude of the output."""
    size = np.hypot(_ADDITIVE_FRACTION, clean / np.sqrt(np.mean(clean**2)))
    return _with_unit_rms(size * rng.standard_normal(clean.size))


def _heavy_tailed(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw white noise with Student's t distribution."""
    return rng.standard_t(_DEGREES_OF_FREEDOM, clean.size) / np.sqrt(
        _DEGREES_OF_FREEDOM / (_DEGREES_OF_FREEDOM - 2.0)
    )


def _non_stationary(rng: np.random.Generator, clean: Signal) -> Signal:
    """Draw white noise whose standard deviation changes slowly over the record."""
    path = np.interp(np.linspace(0.0, 5.0, clean.size), np.arange(6), rng.permutation(np.linspace(0, 1, 6)))
    return _with_unit_rms(_VARIANCE_RANGE**path * rng.standard_normal(clean.size))


def _with_unit_rms(noise: Signal) -> Signal:
    return noise / np.sqrt(np.mean(noise**2))


#: Noise by kind. To add a kind, add an entry.
NOISES: Mapping[str, DrawNoise] = MappingProxyType(
    {
        "white": _white,
        "ar": _autoregressive(0.9),
        "slow-ar": _autoregressive(0.97),
        "arma": _arma,
        "pink": _pink,
        "brown": _brown,
        "multiplicative": _multiplicative,
        "heavy-tailed": _heavy_tailed,
        "non-stationary": _non_stationary,
        "closed-loop": _white,
    }
)

#: Kinds whose noise a feedback controller carries to the input.
FED_BACK = frozenset(("closed-loop",))
