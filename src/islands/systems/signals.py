"""Excitation signals for simulators and test rigs.

Every function returns float64 samples of shape (samples,) on the grid ``k * dt`` from time zero. Random
signals take an explicit seed. Equal arguments give bit-identical signals.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.rounding import ROUNDING

Signal = NDArray[np.float64]
#: Seed of a NumPy generator. A sequence with a spawn key gives independent streams for the same seed.
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
    """Filter white Gaussian noise of variance one by a Butterworth low-pass (excitation of section 6.1).

    Parameters
    ----------
    dt, duration : float
        Sampling time and length in seconds.
    cutoff : float
        Frequency of -3 dB in Hz, below half the sampling frequency.
    seed : int or SeedSequence
        Seed of the noise.
    order : int
        Order of the filter.
    zero_phase : bool
        Whether to filter forward and backward, which gives zero phase, twice the order, and no start at rest.
    peak : float, optional
        Largest absolute value of the scaled signal. By default the signal is not scaled.

    Raises
    ------
    SettingsError
        The cutoff is not between zero and half the sampling frequency.
    """
    samples = _count_samples(dt, duration)
    if not 0.0 < cutoff < 0.5 / dt:
        raise SettingsError(
            f"the cutoff must be between 0 and half the sampling frequency, {0.5 / dt} Hz, got {cutoff}"
        )
    # The API imports this module, and loads no numerical package at its start.
    import scipy  # noqa: PLC0415

    sections = scipy.signal.butter(order, cutoff, fs=1 / dt, output="sos")
    noise = np.random.default_rng(seed).standard_normal(samples)
    apply_filter = scipy.signal.sosfiltfilt if zero_phase else scipy.signal.sosfilt
    filtered: Signal = apply_filter(sections, noise)
    return filtered if peak is None else _scale_to_peak(filtered, peak)


def sine(dt: float, duration: float, amplitude: float, frequency: float, phase: float = 0.0) -> Signal:
    """Return ``amplitude * sin(2 pi frequency t + phase)``; frequency in Hz, phase in radians."""
    return sines(dt, duration, (amplitude,), (frequency,), (phase,))


def sines(
    dt: float,
    duration: float,
    amplitudes: Sequence[float],
    frequencies: Sequence[float],
    phases: Sequence[float] | None = None,
) -> Signal:
    """Return a sum of sines; frequencies in Hz, phases in radians, zero by default.

    Raises
    ------
    SettingsError
        The sequences differ in length.
    """
    phases = (0.0,) * len(amplitudes) if phases is None else phases
    if not len(amplitudes) == len(frequencies) == len(phases):
        raise SettingsError(
            "every sine needs an amplitude, a frequency and a phase; "
            f"got {len(amplitudes)}, {len(frequencies)} and {len(phases)}"
        )
    time = _make_time(dt, duration)
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
    """Return a random-phase multisine: equal harmonics of ``1 / period`` inside a band.

    Parameters
    ----------
    dt, duration : float
        Sampling time and length in seconds. The length need not be a whole number of periods.
    period : float
        Period in seconds, rounded to whole samples.
    band : (float, float)
        Lowest and highest frequency in Hz, both included. The constant is never included.
    seed : int or SeedSequence
        Seed of the phases.
    peak : float
        Largest absolute value of a whole period.

    Raises
    ------
    SettingsError
        No harmonic is inside the band and below half the sampling frequency.
    """
    samples, length = _count_samples(dt, duration), _count_samples(dt, period)
    harmonics = np.arange(1, (length - 1) // 2 + 1)
    # 5e-10 of the harmonic spacing, so that rounding does not exclude a harmonic at the edge of the band.
    slack = 5e-10 / (length * dt)
    frequencies = harmonics / (length * dt)
    harmonics = harmonics[(frequencies >= band[0] - slack) & (frequencies <= band[1] + slack)]
    if harmonics.size == 0:
        raise SettingsError(
            f"no multiple of {1 / (length * dt)} Hz is inside {band} Hz below half the sampling frequency: "
            "widen the band or lengthen the period"
        )
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, harmonics.size)
    spectrum[harmonics] = np.exp(1j * phases)
    one_period: Signal = np.fft.irfft(spectrum, n=length).astype(np.float64)
    return np.resize(_scale_to_peak(one_period, peak), samples)


def sweep(dt: float, duration: float, amplitude: float, first: float, last: float) -> Signal:
    """Return a linear chirp from ``first`` to ``last`` Hz that starts at zero."""
    time = _make_time(dt, duration)
    return amplitude * np.sin(2 * np.pi * (first + (last - first) / (2 * duration) * time) * time)


def triangle(dt: float, duration: float, amplitude: float, frequency: float) -> Signal:
    """Return a triangle wave that starts at zero and rises; frequency in Hz."""
    # Position in the period from the preceding trough, of which zero is a quarter.
    position = (frequency * _make_time(dt, duration) + 0.25) % 1.0
    return amplitude * (1.0 - 4.0 * np.abs(position - 0.5))


def steps(dt: float, duration: float, amplitude: float, frequency: float) -> Signal:
    """Return a staircase 0, amplitude, 0, -amplitude, each for a quarter of a period; frequency in Hz."""
    quarters = np.floor(4.0 * frequency * _make_time(dt, duration) + ROUNDING).astype(np.int64)
    return amplitude * np.array([0.0, 1.0, 0.0, -1.0])[quarters % 4]


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
    """Return periods of a sine followed by a constant level; Figures 5 (c) and (d).

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    duration : float
        Length of the constant part in seconds, not including the sine.
    amplitude, frequency : float
        Amplitude of the sine and its frequency in Hz.
    level : float
        Constant value, within the amplitude.
    loading : bool
        Whether to reach the level on the rising branch. If False, on the falling branch.
    periods : int
        Number of whole periods before the final approach.

    Raises
    ------
    SettingsError
        The sine never reaches the level.
    """
    if amplitude <= 0 or abs(level) > amplitude:
        raise SettingsError(f"a sine of amplitude {amplitude} never reaches the level {level}")
    held = _count_samples(dt, duration)
    rising = np.arcsin(level / amplitude) % (2 * np.pi)
    angle = rising if loading else (np.pi - rising) % (2 * np.pi)
    before = int(np.ceil((periods + angle / (2 * np.pi)) / (frequency * dt) - 1e-9))
    approach = amplitude * np.sin(2 * np.pi * frequency * dt * np.arange(before))
    return np.concatenate([approach, np.full(held, level, dtype=np.float64)])


def minor_loops(
    dt: float,
    *,
    amplitude: float,
    frequency: float,
    reversals: Sequence[float] = (-0.5, 0.5, -0.25, 0.25),
) -> Signal:
    """Return a major loop followed by nested, closed minor loops.

    The input starts at zero and goes to ``+amplitude``, ``-amplitude``, ``+amplitude``, then inwards through
    the reversals and outwards through the same reversals, back to ``+amplitude``. Every loop closes at the
    point where it opened. Each leg is half a cosine whose steepest slope is at most that of a sine of this
    amplitude and frequency, and every turning point is a sample.

    Parameters
    ----------
    dt : float
        Sampling time in seconds.
    amplitude, frequency : float
        Amplitude and frequency of the major loop, which takes ``1 / frequency`` seconds.
    reversals : sequence of float
        Turning points inside the major loop as fractions of the amplitude, at least one. The first is reached
        on the way down; each must be strictly between the two before it.

    Raises
    ------
    SettingsError
        There is no reversal, or the reversals are not nested.
    """
    chain = (-1.0, 1.0, *reversals)
    if len(chain) == 2:
        raise SettingsError("a minor loop needs a reversal: give at least one")
    for outer, previous, inner in zip(chain, chain[1:], chain[2:], strict=False):
        if not min(outer, previous) < inner < max(outer, previous):
            raise SettingsError(f"each reversal must be between the two before it; {inner} in {chain} is not")
    inwards = tuple(reversals)
    corners = amplitude * np.array([0.0, 1.0, -1.0, 1.0, *inwards, *inwards[-2::-1], 1.0])
    half_period = _count_samples(dt, 0.5 / frequency)
    pieces = [corners[:1]]
    for start, stop in pairwise(corners):
        steps = max(2, int(np.ceil(half_period * abs(stop - start) / abs(2 * amplitude) - 1e-9)))
        fraction = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, steps + 1) / steps)
        leg = start + (stop - start) * fraction
        leg[-1] = stop
        pieces.append(leg)
    return np.concatenate(pieces)


def _count_samples(dt: float, duration: float) -> int:
    if not (np.isfinite(dt) and dt > 0):
        raise SettingsError(f"the sampling time must be a positive number of seconds, got {dt}")
    samples = round(duration / dt) if np.isfinite(duration) else 0
    if samples < 1:
        raise SettingsError(f"a signal must have at least one sample of {dt:.10g} s, got {duration:.10g} s")
    return samples


def _make_time(dt: float, duration: float) -> Signal:
    return np.arange(_count_samples(dt, duration), dtype=np.float64) * dt


def _scale_to_peak(signal: Signal, peak: float) -> Signal:
    return signal * (peak / float(np.abs(signal).max()))
