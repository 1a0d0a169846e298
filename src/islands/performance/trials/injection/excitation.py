"""What drives the truth: an excitation, a temperature that wanders, a neighbour that moves."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Signal = NDArray[np.float64]

#: The temperature's and the neighbour's highest frequency, as parts of the excitation's.
_SLOW, _NEAR = 0.05, 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """What acts on the truth, at the truth's own rate, and the sizes that strengths refer to.

    Attributes
    ----------
    time, u : ndarray, shape (samples,)
        Seconds, and the input.
    temperature : ndarray, shape (samples,)
        In K, from where it began.
    neighbour : ndarray, shape (samples,)
        Its largest value is 1.
    rate : float
        Samples a second.
    peak, output : float
        The usual largest input and output.
    """

    time: Signal
    u: Signal
    temperature: Signal
    neighbour: Signal
    rate: float
    peak: float
    output: float


def make_excitation(
    rng: np.random.Generator, u: Signal, rate: float, band: float, peak: float, output: float
) -> Excitation:
    """Draw what acts on the truth beside its input; ``band`` is the input's highest frequency in Hz."""
    wander = np.cumsum(random_noise(rng, u.size, rate, _SLOW * band, band))
    wander -= wander[0]
    neighbour = random_noise(rng, u.size, rate, _NEAR * band, band)
    return Excitation(
        np.arange(u.size) / rate,
        u,
        wander / np.ptp(wander),
        neighbour / np.max(np.abs(neighbour)),
        rate,
        peak,
        output,
    )


def random_noise(rng: np.random.Generator, count: int, rate: float, band: float, quickest: float) -> Signal:
    """Return noise below a frequency.

    What the filter needs to begin and to end is cut off: four periods of the quickest that is drawn.
    """
    spare = int(4 * rate / quickest)
    poles = scipy.signal.butter(2, band, fs=rate, output="sos")
    smooth: Signal = scipy.signal.sosfiltfilt(poles, rng.standard_normal(count + 2 * spare))
    return smooth[spare:-spare]


def multisine(rng: np.random.Generator, count: int, rate: float, band: float) -> Signal:
    """Return sines of equal size and random phases: all that are periodic in the record, up to a band."""
    lines = np.arange(1, int(band * count / rate) + 1)
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(1j * rng.uniform(0.0, 2 * np.pi, lines.size))
    return np.fft.irfft(spectrum, count)


def random_sign(rng: np.random.Generator) -> float:
    """Draw a sign."""
    return float(rng.choice([-1.0, 1.0]))
