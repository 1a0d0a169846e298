"""Excitations: the inputs that drive a simulator or a test rig.

Every function returns float64 samples of shape (samples,) on the grid ``k * dt`` and begins at time zero.
Chance comes from an explicit seed alone: the same arguments give the same bits.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.errors import SettingsError

Signal = NDArray[np.float64]
#: What seeds a NumPy generator; a sequence with a spawn key keeps two purposes of one seed apart.
Seed = int | np.random.SeedSequence


def filtered_noise(
    dt: float,
    duration: float,
    cutoff: float,
    seed: Seed,
    *,
    order: int = 5,
    zero_phase: bool = False,
    peak: float | None = None,
) -> Signal:
    """White Gaussian noise of variance one through a Butterworth low-pass; section 6.1's excitation.

    Parameters
    ----------
    dt, duration : float
        Sampling time and length in seconds.
    cutoff : float
        The filter's -3 dB frequency in Hz, below half the sampling frequency.
    seed : int or SeedSequence
        Seeds the noise.
    order : int
        Order of the filter.
    zero_phase : bool
        Filter forward and backward: no phase, twice the order, and no start from rest.
    peak : float, optional
        Scale the signal so that its largest absolute value is this; unscaled without it.

    Raises
    ------
    SettingsError
        The cutoff does not lie between zero and half the sampling frequency.
    """
    samples = _samples(dt, duration)
    if not 0.0 < cutoff < 0.5 / dt:
        raise SettingsError(
            f"the cutoff lies between 0 and half the sampling frequency, {0.5 / dt} Hz, got {cutoff}"
        )
    sections = scipy.signal.butter(order, cutoff, fs=1 / dt, output="sos")
    noise = np.random.default_rng(seed).standard_normal(samples)
    run = scipy.signal.sosfiltfilt if zero_phase else scipy.signal.sosfilt
    filtered: Signal = run(sections, noise)
    return filtered if peak is None else _to_peak(filtered, peak)


def sine(dt: float, duration: float, amplitude: float, frequency: float, phase: float = 0.0) -> Signal:
    """``amplitude * sin(2 pi frequency t + phase)``: frequency in Hz, phase in radians."""
    return sines(dt, duration, (amplitude,), (frequency,), (phase,))


def sines(
    dt: float,
    duration: float,
    amplitudes: Sequence[float],
    frequencies: Sequence[float],
    phases: Sequence[float] | None = None,
) -> Signal:
    """Sum of sines: frequencies in Hz, phases in radians, zero where not given.

    Raises
    ------
    SettingsError
        The sequences differ in length.
    """
    phases = (0.0,) * len(amplitudes) if phases is None else phases
    if not len(amplitudes) == len(frequencies) == len(phases):
        raise SettingsError(
            "every sine has an amplitude, a frequency and a phase; "
            f"got {len(amplitudes)}, {len(frequencies)} and {len(phases)}"
        )
    time = _time(dt, duration)
    total = np.zeros_like(time)
    for amplitude, frequency, phase in zip(amplitudes, frequencies, phases, strict=True):
        total += amplitude * np.sin(2 * np.pi * frequency * time + phase)
    return total


def multisine(
    dt: float,
    duration: float,
    period: float,
    band: tuple[float, float],
    seed: Seed,
    *,
    peak: float = 1.0,
) -> Signal:
    """Periodic noise: equal harmonics of ``1 / period`` inside a band, with phases from a seed.

    Parameters
    ----------
    dt, duration : float
        Sampling time and length in seconds; the length need not be a whole number of periods.
    period : float
        Period in seconds, rounded to whole samples.
    band : (float, float)
        Lowest and highest frequency in Hz, both included; the constant is never part of it.
    seed : int or SeedSequence
        Seeds the phases.
    peak : float
        Largest absolute value of a whole period.

    Raises
    ------
    SettingsError
        No harmonic lies inside the band and below half the sampling frequency.
    """
    samples, length = _samples(dt, duration), _samples(dt, period)
    harmonics = np.arange(1, (length - 1) // 2 + 1)
    # Half a part in 1e9: an edge that is a harmonic on paper stays inside after rounding.
    slack = 5e-10 / (length * dt)
    frequencies = harmonics / (length * dt)
    harmonics = harmonics[(frequencies >= band[0] - slack) & (frequencies <= band[1] + slack)]
    if harmonics.size == 0:
        raise SettingsError(
            f"no multiple of {1 / (length * dt)} Hz lies inside {band} Hz below half the sampling frequency: "
            "widen the band or lengthen the period"
        )
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, harmonics.size)
    spectrum[harmonics] = np.exp(1j * phases)
    whole: Signal = np.fft.irfft(spectrum, n=length).astype(np.float64)
    return np.resize(_to_peak(whole, peak), samples)


def sweep(dt: float, duration: float, amplitude: float, first: float, last: float) -> Signal:
    """Sine whose frequency runs linearly from ``first`` to ``last`` Hz (a linear chirp), from zero."""
    time = _time(dt, duration)
    return amplitude * np.sin(2 * np.pi * (first + (last - first) / (2 * duration) * time) * time)


def hold_signal(
    dt: float,
    duration: float,
    *,
    amplitude: float,
    frequency: float,
    level: float,
    loading: bool = True,
    periods: int = 2,
) -> Signal:
    """Whole periods of a sine, then on to a level, then rest there; Figures 5 (c) and (d).

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    duration : float
        Seconds at rest; the sine before them comes on top.
    amplitude, frequency : float
        The sine that leads there; frequency in Hz.
    level : float
        Where the input rests, within the amplitude.
    loading : bool
        Reach the level on the rising branch; False: on the falling one.
    periods : int
        Whole periods before the last approach.

    Raises
    ------
    SettingsError
        The sine never reaches the level.
    """
    if amplitude <= 0 or abs(level) > amplitude:
        raise SettingsError(f"a sine of amplitude {amplitude} never reaches the level {level}")
    rest = _samples(dt, duration)
    rising = np.arcsin(level / amplitude) % (2 * np.pi)
    angle = rising if loading else (np.pi - rising) % (2 * np.pi)
    before = int(np.ceil((periods + angle / (2 * np.pi)) / (frequency * dt) - 1e-9))
    approach = amplitude * np.sin(2 * np.pi * frequency * dt * np.arange(before))
    return np.concatenate([approach, np.full(rest, level, dtype=np.float64)])


def minor_loops(
    dt: float,
    *,
    amplitude: float,
    frequency: float,
    reversals: Sequence[float] = (-0.5, 0.5, -0.25, 0.25),
) -> Signal:
    """Major loop, then closed minor loops nested in each other.

    From rest at zero the input runs to ``+amplitude``, ``-amplitude``, ``+amplitude``, then through the
    reversals inwards and through the same reversals outwards, back to ``+amplitude``: every loop that was
    opened is closed where it began. Each leg is half a cosine whose steepest slope is at most that of a sine
    of this amplitude and frequency, and every turning point is a sample.

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    amplitude, frequency : float
        The major loop; a full one lasts ``1 / frequency`` seconds.
    reversals : sequence of float
        Turning points inside the major loop as fractions of the amplitude, at least one, the first on the
        way down; each lies strictly between the two before it.

    Raises
    ------
    SettingsError
        There is no reversal, or they are not nested.
    """
    chain = (-1.0, 1.0, *reversals)
    if len(chain) == 2:
        raise SettingsError("a minor loop has a reversal: give at least one")
    for outer, previous, inner in zip(chain, chain[1:], chain[2:], strict=False):
        if not min(outer, previous) < inner < max(outer, previous):
            raise SettingsError(f"each reversal lies between the two before it; {inner} in {chain} does not")
    inwards = tuple(reversals)
    corners = amplitude * np.array([0.0, 1.0, -1.0, 1.0, *inwards, *inwards[-2::-1], 1.0])
    half_period = _samples(dt, 0.5 / frequency)
    pieces = [corners[:1]]
    for start, stop in pairwise(corners):
        steps = max(2, int(np.ceil(half_period * abs(stop - start) / abs(2 * amplitude) - 1e-9)))
        way = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, steps + 1) / steps)
        leg = start + (stop - start) * way
        leg[-1] = stop
        pieces.append(leg)
    return np.concatenate(pieces)


def _samples(dt: float, duration: float) -> int:
    if not (np.isfinite(dt) and dt > 0):
        raise SettingsError(f"the sampling time is a positive number of seconds, got {dt}")
    samples = round(duration / dt) if np.isfinite(duration) else 0
    if samples < 1:
        raise SettingsError(f"a signal is at least one sample of {dt} s long, got {duration} s")
    return samples


def _time(dt: float, duration: float) -> Signal:
    return np.arange(_samples(dt, duration), dtype=np.float64) * dt


def _to_peak(signal: Signal, peak: float) -> Signal:
    return signal * (peak / float(np.abs(signal).max()))
