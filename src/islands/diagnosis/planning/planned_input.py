"""Inputs of experiments within limits of amplitude and rate, such as multisines and steps with holds."""

from dataclasses import dataclass
from enum import StrEnum
from math import inf

import numpy as np

from islands.effects.interface.context import Signal
from islands.errors import SettingsError
from islands.systems.signals import multisine, sine, sweep, triangle

#: Shortest period or hold, in samples.
MIN_SAMPLES = 8

#: Smallest number of periods or holds in an input.
MIN_REPEATS = 3


class InputForm(StrEnum):
    """Form of an input."""

    MULTISINE = "multisine"
    STEPS = "steps"
    SINE = "sine"
    SWEEP = "sweep"
    TRIANGLE = "triangle"


@dataclass(frozen=True, slots=True)
class InputLimits:
    """Limits that an input stays within.

    Attributes
    ----------
    lower, upper : float
        Smallest and largest value, in the unit of the input.
    rate : float
        Largest absolute change per second.
    """

    lower: float
    upper: float
    rate: float = inf

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lower, self.upper]).all() and self.lower < self.upper and self.rate > 0.0):
            raise SettingsError(
                f"an input between {self.lower:g} and {self.upper:g} with a rate of at most {self.rate:g} is "
                "not possible: give a positive amplitude and a positive rate"
            )

    @property
    def middle(self) -> float:
        """Value halfway between the limits."""
        return (self.lower + self.upper) / 2

    @property
    def amplitude(self) -> float:
        """Half of the range."""
        return (self.upper - self.lower) / 2

    def contains(self, u: Signal, dt: float) -> bool:
        """Return whether a signal is within the limits, up to rounding."""
        slack = 1e-9 * self.amplitude
        low, high = float(np.min(u)), float(np.max(u))
        return (
            low >= self.lower - slack
            and high <= self.upper + slack
            and find_rate(u, dt) <= self.rate * (1 + 1e-9)
        )


@dataclass(frozen=True, slots=True)
class PlannedInput:
    """An input about the middle of its limits.

    Attributes
    ----------
    form : InputForm
    share : float
        Amplitude as a fraction of that of the limits.
    frequency : float
        In Hz: highest frequency of a multisine or a sweep, frequency of a sine or a triangle wave, or levels
        per second of steps.
    lowest : float
        Lowest frequency of a multisine or a sweep in Hz; not used by other forms.
    seed : int
        Seed of phases or levels.
    """

    form: InputForm
    share: float
    frequency: float
    lowest: float = 0.0
    seed: int = 0

    def describe(self, limits: InputLimits, unit: str) -> str:
        """Return the form with its numbers as text."""
        size = f"amplitude {self.share * limits.amplitude:.3g} {unit}".rstrip()
        match self.form:
            case InputForm.MULTISINE:
                return f"multisine from {self.lowest:.3g} to {self.frequency:.3g} Hz, {size}"
            case InputForm.STEPS:
                return f"random steps with holds of {1.0 / self.frequency:.3g} s, {size}"
            case InputForm.SINE:
                return f"sine of {self.frequency:.3g} Hz, {size}"
            case InputForm.SWEEP:
                return f"sweep from {self.lowest:.3g} to {self.frequency:.3g} Hz, {size}"
            case InputForm.TRIANGLE:
                return f"triangle wave of {self.frequency:.3g} Hz, {size}"

    def make(self, limits: InputLimits, dt: float, samples: int) -> Signal:
        """Make the input; its amplitude is reduced if its rate would exceed the limit.

        Returns
        -------
        ndarray, shape (samples,)
        """
        duration, amplitude = samples * dt, self.share * limits.amplitude
        match self.form:
            case InputForm.MULTISINE:
                band = (self.lowest, max(self.frequency, self.lowest + 1.5 / duration))
                wave = multisine(dt, duration, duration, band, self.seed, peak=amplitude)
            case InputForm.SINE:
                wave = sine(dt, duration, amplitude, self.frequency)
            case InputForm.SWEEP:
                wave = sweep(dt, duration, amplitude, self.lowest, self.frequency)
            case InputForm.TRIANGLE:
                wave = triangle(dt, duration, amplitude, self.frequency)
            case InputForm.STEPS:
                return limits.middle + self._make_steps(amplitude, limits.rate, dt, samples)
        reduced: Signal = limits.middle + wave * min(1.0, limits.rate / max(find_rate(wave, dt), 1e-300))
        return reduced

    def _make_steps(self, amplitude: float, rate: float, dt: float, samples: int) -> Signal:
        """Make random levels, each held; the rate limits the changes between them."""
        rng = np.random.default_rng(self.seed)
        hold = max(1.0 / self.frequency, dt)
        count = int(np.ceil(samples * dt / hold)) + 1
        # Both ends of the range occur early, and every step is larger than a tenth of it.
        levels = (
            np.concatenate([[0.0, 1.0, -1.0], rng.uniform(-1.0, 1.0, max(count - 3, 0))])[:count] * amplitude
        )
        changes = np.abs(np.diff(levels))
        ramps = np.maximum(changes / rate, dt)
        ends = np.cumsum(ramps + hold)
        times = np.concatenate([[0.0, hold], np.column_stack([ends, ends + hold]).ravel()])
        values = np.concatenate([[levels[0], levels[0]], np.repeat(levels[1:], 2)])
        steps: Signal = np.interp(dt * np.arange(samples), times, values)
        return steps


def find_rate(u: Signal, dt: float) -> float:
    """Return the largest absolute change per second."""
    return float(np.max(np.abs(np.diff(u)), initial=0.0)) / dt


def find_limits(
    u: Signal, dt: float, amplitude: float | None = None, rate: float | None = None
) -> InputLimits:
    """Return the limits of an input: its range and its largest rate, unless others are given.

    Parameters
    ----------
    amplitude : float, optional
        Half of the range, about the middle of that of the input.
    rate : float, optional

    Raises
    ------
    SettingsError
        A limit is not positive, or the input rests and no other limit is given.
    """
    lower, upper = float(np.min(u)), float(np.max(u))
    middle, half = (lower + upper) / 2, (upper - lower) / 2 if amplitude is None else amplitude
    return InputLimits(middle - half, middle + half, find_rate(u, dt) if rate is None else rate)
