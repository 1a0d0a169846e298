"""What drives the truth: noise through a low-pass, a temperature that wanders, a neighbour that moves."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Signal = NDArray[np.float64]

#: Samples a second of the truth, and how many of them make one of the record.
RATE, DECIMATION = 1000, 10

#: Largest input in V, and the frequency in Hz up to which it moves.
PEAK, BAND = 40.0, 1.0

#: Largest output of the actuator in um, and the usual rate of its input in V/s: what strengths refer to.
OUTPUT, SPEED = 45.0, 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """What acts on the truth, at its own rate.

    Attributes
    ----------
    time, u : ndarray, shape (samples,)
        Seconds, and volts.
    temperature : ndarray, shape (samples,)
        In K, from where it began.
    neighbour : ndarray, shape (samples,)
        In V.
    """

    time: Signal
    u: Signal
    temperature: Signal
    neighbour: Signal


def drive(rng: np.random.Generator, seconds: float) -> Drive:
    """Draw what acts on the truth; the input begins at rest."""
    count = int(seconds * RATE)
    time = np.arange(count) / RATE
    u = _noise(rng, count, BAND) * np.minimum(1.0, time)
    wander = np.cumsum(_noise(rng, count, 0.05))
    wander -= wander[0]
    neighbour = _noise(rng, count, 0.7 * BAND)
    return Drive(
        time,
        PEAK * u / np.max(np.abs(u)),
        wander / np.ptp(wander),
        neighbour / np.max(np.abs(neighbour)),
    )


def _noise(rng: np.random.Generator, count: int, band: float) -> Signal:
    """Return noise below a frequency; what the filter needs to begin and to end is cut off."""
    spare = 4 * RATE
    poles = scipy.signal.butter(2, band, fs=RATE, output="sos")
    smooth: Signal = scipy.signal.sosfiltfilt(poles, rng.standard_normal(count + 2 * spare))
    return smooth[spare:-spare]
