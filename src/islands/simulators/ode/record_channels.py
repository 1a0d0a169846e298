"""Columns of a record that a simulator reads: its input with smaller steps, and channels."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from islands.effects.interface.context import Signal, SimulationContext
from islands.errors import RecordError, suggest
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.simulators.ode.sampled_signal import SampledSignal, interpolate_linearly


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
    found = [each for each in record.input_names[1:] if each == name or parse_channel_name(each).stem == name]
    if len(found) != 1:
        others = ", ".join(record.input_names[1:]) or "none"
        raise RecordError(
            f"{reader} the channel {name}, and the channels of the record are {others}: give its column as "
            f"a channel, and name it {name} there"
            f"{suggest(name, record.input_names[1:])}"
        )
    return found[0]


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
