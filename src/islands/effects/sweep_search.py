"""Search for a line in a signal whose frequency changes at a constant rate, behind a linear system or not.

The signal is multiplied by sweeps of the opposite rate, after which the line is a peak in a spectrum. That
takes windows of some hundred samples, whose powers are summed along the line. The windows are then
doubled, with rates near those found before, until one window is the signal.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from islands.effects.interface.effect import Signal

#: Largest length of the first windows, in samples.
WINDOW = 512

#: Largest step of the rates that are tried, in cycles per window, and in cycles per window between the first
#: window and the last. A line is then at most half of that away.
STEP, LINE_STEP = 2.0, 4.0

#: Least frequency in cycles per signal.
MIN_CYCLES = 2

#: Fraction of the largest power of a response below which a sweep is not visible.
MIN_RESPONSE = 1e-3

#: Least power of the spectrum of an input, relative to its largest one, from which a response is computed.
MIN_POWER = 1e-8


@dataclass(frozen=True, slots=True)
class SweptLine:
    """A line: frequency at the first sample in cycles per sample, its rate, and its power."""

    frequency: float
    rate: float
    power: float


def compute_response(u: Signal, y: Signal) -> Signal:
    """Return the frequency response from one signal to another, for spectra of twice their length."""
    window, size = np.hanning(u.size), 2 * u.size
    before, after = (np.fft.rfft((each - each.mean()) * window, size) for each in (u, y))
    smoothing = np.hanning(9)[1:-1]
    power = np.convolve(np.abs(before) ** 2, smoothing, mode="same")
    product = np.convolve(after * before.conj(), smoothing, mode="same")
    is_excited = power > MIN_POWER * power.max()
    return np.asarray(np.where(is_excited, product / np.where(is_excited, power, 1.0), 0.0))


def respond(signal: Signal, response: Signal) -> Signal:
    """Return a signal behind a frequency response."""
    spectrum = np.fft.rfft(signal, 2 * signal.size) * response
    return np.asarray(np.fft.irfft(spectrum, 2 * signal.size)[: signal.size])


def find_sweep(signal: Signal, response: Signal | None, min_change: float) -> SweptLine | None:
    """Return the sweep that explains most of a signal; None if there is none.

    Parameters
    ----------
    signal : ndarray, shape (samples,)
        Signal without a mean.
    response : ndarray or None
        Frequency response (`compute_response`) that is between the sweep and the signal; None for none.
    min_change : float
        Least change of the frequency, in cycles per signal.
    """
    if response is None:
        energy = np.ones(signal.size + 1)
    else:  # A matched filter.
        signal, energy = respond(signal, response.conj()), np.asarray(np.abs(response) ** 2)
    count = 1
    while signal.size > count * WINDOW:
        count *= 2
    least, found = min_change / count**2, None
    length = signal.size // count
    step = min(STEP, LINE_STEP / count)
    most = int(length / (2 * count) / step)
    sweeps = step * np.arange(-most, most + 1)
    while True:
        sweeps = sweeps[np.abs(sweeps) >= least]
        found = _find_line(signal, energy, count, sweeps)
        if found is None or count == 1:
            return found
        count //= 2
        least *= 4.0
        length = signal.size // count
        sweeps = found.rate * length**2 + min(STEP, LINE_STEP / count) * np.arange(-2, 3)


def measure_line(signal: Signal) -> float:
    """Return the fraction of the power of a signal that is one line, steady or swept."""
    found, total = find_sweep(signal, None, 0.0), float(signal @ signal)
    return found.power / total if found is not None and total > 0.0 else 0.0


def _find_line(signal: Signal, energy: Signal, count: int, sweeps: Iterable[float]) -> SweptLine | None:
    """Return the best line among sweeps in cycles per window, summed over a number of windows."""
    length = signal.size // count
    windows = signal[: count * length].reshape(count, length)
    size, time = 2 * length, np.arange(length) / length
    sums = np.concatenate([[0.0], np.cumsum(energy)])
    width = (energy.size - 1) / length  # of a frequency of a window, in those of the energy
    lowest, start = 2 * MIN_CYCLES / count, np.arange(length)
    best: SweptLine | None = None
    for sweep in sweeps:
        spectra = np.abs(np.fft.fft(windows * np.exp(-1j * np.pi * sweep * time**2), size)) ** 2
        end = start + 2 * sweep * count
        usable = start[(np.minimum(start, end) >= lowest) & (np.maximum(start, end) < length)]
        if not usable.size:
            continue
        line = np.zeros(usable.size)
        for index, spectrum in enumerate(spectra):
            line += spectrum[usable + round(2 * sweep * index)]
        first, last = (
            np.round(width * edge(usable, usable + 2 * sweep * count)).astype(np.intp)
            for edge in (np.minimum, np.maximum)
        )
        mean = (sums[last + 1] - sums[first]) / (last + 1 - first)
        is_visible = mean > MIN_RESPONSE * energy.max()
        power = np.where(is_visible, line / np.where(is_visible, mean, 1.0), 0.0)
        place = int(np.argmax(power))
        # A line of amplitude a has the power a^2/2 in each sample, and a length/2 in the spectrum.
        if power[place] > 0.0 and (best is None or 2.0 * power[place] / length > best.power):
            best = SweptLine(usable[place] / size, sweep / length**2, float(2.0 * power[place] / length))
    return best
