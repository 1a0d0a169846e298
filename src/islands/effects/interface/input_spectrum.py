"""Spectrum of the input: whether it has one frequency only."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.effect import Signal, SimulationContext

#: Half width of a line in the spectrum, relative to the resolution.
LINE_WIDTH = 2.0

#: Least number of periods of an input in the estimation part, so that there is space between its harmonics.
MIN_PERIODS = 8

#: Fraction of the power of the input in its largest line, from which it has one frequency only.
MIN_LINE_POWER = 0.8


def compute_spectrum(signal: Signal) -> NDArray[np.floating[Any]]:
    """Return the spectrum of a signal; zero padding resolves frequencies between its bins."""
    return np.abs(np.fft.rfft(signal * np.hanning(signal.size), 4 * signal.size))


def find_single_frequency(context: SimulationContext) -> float | None:
    """Return the frequency in Hz of an input with a single line in its spectrum, otherwise None."""
    resolution = 1.0 / context.fit_end_time
    u = context.u[: int(context.fit_end_time / context.dt)]
    spectrum = compute_spectrum(u - u.mean()) ** 2
    frequencies = np.fft.rfftfreq(4 * u.size, context.dt)
    line = float(frequencies[np.argmax(spectrum)])
    is_near = np.abs(frequencies - line) < LINE_WIDTH * resolution
    is_resolved = line >= MIN_PERIODS * resolution
    return line if is_resolved and spectrum[is_near].sum() >= MIN_LINE_POWER * spectrum.sum() else None
