"""Signals between their samples, and the columns of a record that a simulator reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from islands.effects.interface.context import Signal, SimulationContext
from islands.errors import RecordError, suggest
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.simulators.ode.equation_parser import TIME


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


def find_channel(name: str, record: Dataset, reader: str) -> str:
    """Return the channel of a record that has a name, with or without a unit behind it.

    Parameters
    ----------
    reader : str
        What reads the channel, for the message.

    Raises
    ------
    RecordError
        There is no such channel, or several.
    """
    channels = [
        column
        for column in record.input_names[1:]
        if column == name or parse_channel_name(column).stem == name
    ]
    if len(channels) != 1:
        others = ", ".join(record.input_names[1:]) or "none"
        raise RecordError(
            f"{reader} the channel {name}, and the channels of the record are {others}: give its column as "
            f"a channel, and name it {name} there"
            f"{suggest(name, record.input_names[1:])}"
        )
    return channels[0]


def sample_channels(
    context: SimulationContext, channels: Mapping[str, str], samples: int, is_held: bool
) -> dict[str, SampledSignal]:
    """Return channels with a given number of samples, interpolated linearly.

    Parameters
    ----------
    channels : mapping
        Channels of the record by the names that a simulator gives to them.
    is_held : bool
        Whether a signal is constant within each step; otherwise it is linear.
    """
    found = {}
    for name, recorded in channels.items():
        signal = context.channels[recorded]
        steps = np.arange(samples) * (signal.size / samples)
        values = np.interp(steps, np.arange(signal.size), signal)
        found[name] = SampledSignal.join(values, values, values) if is_held else interpolate_linearly(values)
    return found


def refine_input(x: Signal, between: Signal, parts: int) -> SampledSignal:
    """Return an input with each step divided; successive simulations have it in common.

    Parameters
    ----------
    x : ndarray, shape (samples,)
        Input at the start of each step.
    between : ndarray, shape (2, samples)
        Input in the middle and at the end of each step.
    parts : int
    """
    return _refine_bytes(x.tobytes(), between.tobytes(), parts)


@lru_cache(maxsize=4)
def _refine_bytes(x: bytes, between: bytes, parts: int) -> SampledSignal:
    return SampledSignal.join(np.frombuffer(x), *np.frombuffer(between).reshape(2, -1)).refine(parts)


def make_nominal_context(record: Dataset) -> SimulationContext:
    """Return the context of a simulation that determines scales: that of the longest recording.

    Raises
    ------
    RecordError
        The recording has one sample.
    """
    part = record.longest_segment
    if part.samples < 2:
        raise RecordError(f"the record has {part.samples} sample, and a simulation needs two: give more rows")
    names, units = part.input_names, part.input_units
    signals = {name: np.ascontiguousarray(u) for name, u in zip(names, part.u.T, strict=True)}
    return SimulationContext(
        u=signals[names[0]],
        dt=part.dt,
        channels=signals,
        units=dict(zip(names, units, strict=True)),
        input_peak=1.0,
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=part.output_unit or "1",
        fit_end_time=part.samples * part.dt,
    )
