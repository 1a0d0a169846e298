"""Signals that a simulation reads three times in each step: at its start, in its middle and at its end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.simulators.ode.equation_parser import TIME

Signal = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SampledSignal:
    """A signal at the start, in the middle and at the end of each step.

    The end of a step is the start of the next one, unless the signal jumps there.

    Attributes
    ----------
    moments : ndarray, shape (samples, 3)
    has_kinks : bool
        Whether the signal has kinks or jumps within steps, as after a map.
    """

    moments: Signal
    has_kinks: bool = False

    @classmethod
    def join(cls, start: Signal, middle: Signal, end: Signal) -> "SampledSignal":
        """Make a signal of its values at the three moments, each of shape (samples,)."""
        moments = np.empty((start.size, 3))
        moments[:, 0], moments[:, 1], moments[:, 2] = start, middle, end
        return cls(moments)

    @property
    def start(self) -> Signal:
        """Values at the start of each step, shape (samples,)."""
        return self.moments[:, 0]

    @property
    def middle(self) -> Signal:
        """Values in the middle of each step, shape (samples,)."""
        return self.moments[:, 1]

    @property
    def end(self) -> Signal:
        """Values at the end of each step, shape (samples,)."""
        return self.moments[:, 2]

    @property
    def is_held(self) -> bool:
        """Whether the signal is constant within each step."""
        return bool((self.moments[:, 1:] == self.moments[:, :1]).all())

    def _list_rises(self) -> tuple[Signal, Signal]:
        """Return how much the signal rises in the halves of each step, each of shape (samples,)."""
        return self.middle - self.start, self.end - self.middle

    def differentiate(self, dt: float) -> "SampledSignal":
        """Return the rate: the derivative of the parabola through the values of each step.

        A held signal would have impulses; its rate is that of a ramp to the next value within the step. A
        parabola may turn next to a kink where the signal does not. The rate of a signal with kinks is such
        that its integral and that of its magnitude by Simpson's rule are those of the signal, and continuous
        in its values.
        """
        if self.is_held:
            rate = np.append(np.diff(self.start), 0.0) / dt
            return SampledSignal.join(rate, rate, rate)
        first, second = self._list_rises()
        start, middle, end = 3.0 * first - second, first + second, 3.0 * second - first
        if self.has_kinks:
            start, end = _find_rate_at_end(first, second), _find_rate_at_end(second, first)
        return SampledSignal.join(start / dt, middle / dt, end / dt)

    def refine(self, parts: int) -> "SampledSignal":
        """Return the signal with each step divided, by the parabola through the values of the step."""
        if parts == 1:
            return self
        first, second = self._list_rises()
        linear, quadratic = 3.0 * first - second, 2.0 * (second - first)
        places = (np.arange(parts)[:, None] + np.array([0.0, 0.5, 1.0])) / parts
        # start + place*(linear + place*quadratic), without arrays for intermediate results
        moments = np.multiply(quadratic[:, None, None], places)
        moments += linear[:, None, None]
        moments *= places
        moments += self.start[:, None, None]
        return SampledSignal(moments.reshape(-1, 3))

    def scale(self, factors: Signal) -> "SampledSignal":
        """Return the signal multiplied by a factor for each step, shape (samples,)."""
        return replace(self, moments=self.moments * factors[:, None])

    def delay(self, seconds: float, dt: float) -> "SampledSignal":
        """Return the signal delayed by linear interpolation; before the first sample it is constant.

        A held signal is averaged over the step, so that the result is continuous in the delay.
        """
        samples = len(self.moments)
        steps = np.arange(samples, dtype=np.float64) - seconds / dt
        if self.is_held:
            held = np.interp(steps, np.arange(samples), self.start)
            return SampledSignal.join(held, held, held)
        fine = np.append(self.moments[:, :2].reshape(-1), self.moments[-1, 2])
        places = 0.5 * np.arange(fine.size)
        return SampledSignal.join(*(np.interp(steps + part, places, fine) for part in (0.0, 0.5, 1.0)))


def _find_rate_at_end(near: Signal, far: Signal) -> Signal:
    """Return the rate of a signal with kinks at an end of each step, times the duration of the step.

    Parameters
    ----------
    near, far : ndarray, shape (samples,)
        How much the signal rises in the half of the step at this end, and in the other one.
    """
    largest = 2.0 * (near + far)
    steady = np.clip(3.0 * near - far, np.minimum(largest, 0.0), np.maximum(largest, 0.0))
    turning = np.where(np.abs(near) >= np.abs(far), 2.0 * near - 4.0 * far, 6.0 * near)
    return np.where(near * far < 0.0, turning, steady)


def interpolate_linearly(signal: Signal) -> SampledSignal:
    """Return a signal that is linear between its samples, and constant after the last one."""
    end = np.append(signal[1:], signal[-1])
    return SampledSignal.join(signal, (signal + end) / 2, end)


def make_time(start: float, samples: int, dt: float) -> dict[str, SampledSignal]:
    """Return the time as a signal, under its name in equations."""
    time = start + dt * np.arange(samples, dtype=np.float64)
    return {TIME: SampledSignal.join(time, time + 0.5 * dt, time + dt)}


def stack_signals(signals: Sequence[SampledSignal], samples: int) -> Signal:
    """Return signals as one array, shape (samples, 3, signals)."""
    if not signals:
        return np.empty((samples, 3, 0))
    return np.stack([each.moments for each in signals], axis=2)


def chain_signals(signals: Sequence[SampledSignal], samples: int) -> Signal:
    """Return signals one after another, shape (signals * samples, 3, 1), padded with zeros behind the end."""
    chained = np.zeros((len(signals), samples, 3))
    for row, each in zip(chained, signals, strict=True):
        row[: len(each.moments)] = each.moments
    return chained.reshape(-1, 3, 1)
