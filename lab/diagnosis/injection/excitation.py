"""Excitations of a plant: input, drifting temperature, and the signal of a neighbouring channel."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Signal = NDArray[np.float64]

#: Highest frequency of the temperature relative to that of the input.
_TEMPERATURE_BAND = 0.05

#: Highest frequency of the neighbour relative to that of the input.
_NEIGHBOUR_BAND = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """Signals that act on a plant, at the plant's sampling rate, and the reference values of fault strengths.

    Attributes
    ----------
    time, u : ndarray, shape (samples,)
        Time in seconds, and the input.
    temperature : ndarray, shape (samples,)
        Change of the temperature since the first sample, scaled to a range of 1 K.
    neighbour : ndarray, shape (samples,)
        Signal of the neighbouring channel; its largest absolute value is 1.
    rate : float
        Samples per second.
    peak_input, peak_output : float
        Typical largest input and output.
    """

    time: Signal
    u: Signal
    temperature: Signal
    neighbour: Signal
    rate: float
    peak_input: float
    peak_output: float


def make_excitation(
    rng: np.random.Generator, u: Signal, rate: float, band: float, peak_input: float, peak_output: float
) -> Excitation:
    """Add a random temperature and neighbour to an input; ``band`` is the input's highest frequency in Hz."""
    temperature = np.cumsum(random_noise(rng, u.size, rate, _TEMPERATURE_BAND * band, band))
    temperature -= temperature[0]
    neighbour = random_noise(rng, u.size, rate, _NEIGHBOUR_BAND * band, band)
    return Excitation(
        np.arange(u.size) / rate,
        u,
        temperature / np.ptp(temperature),
        neighbour / np.max(np.abs(neighbour)),
        rate,
        peak_input,
        peak_output,
    )


def random_noise(
    rng: np.random.Generator, count: int, rate: float, band: float, padding_frequency: float
) -> Signal:
    """Return Gaussian noise through a low-pass filter with a cut-off frequency of ``band`` Hz.

    Four periods of ``padding_frequency`` are cut off at both ends, to remove the transients of the filter.
    """
    padding = int(4 * rate / padding_frequency)
    sections = scipy.signal.butter(2, band, fs=rate, output="sos")
    smooth: Signal = scipy.signal.sosfiltfilt(sections, rng.standard_normal(count + 2 * padding))
    return smooth[padding:-padding]


def multisine(rng: np.random.Generator, count: int, rate: float, band: float) -> Signal:
    """Return a random-phase multisine with equal amplitudes at all harmonics of the record up to a band."""
    lines = np.arange(1, int(band * count / rate) + 1)
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(1j * rng.uniform(0.0, 2 * np.pi, lines.size))
    return np.fft.irfft(spectrum, count)


def random_sign(rng: np.random.Generator) -> float:
    """Draw -1 or 1."""
    return float(rng.choice([-1.0, 1.0]))
