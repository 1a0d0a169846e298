"""Channels of a context that vary: the first temperature, recognised by its unit, and the first other one."""

import numpy as np

from islands.effects.interface.context import Signal, SimulationContext
from islands.errors import RecordError
from islands.records.channel_names import TEMPERATURES

#: Notes on the formulas of effects of a channel.
TEMPERATURE_NOTE = "{T} is the first temperature among the channels, {T_0} its first value"
CHANNEL_NOTE = "{w} is the first channel that is not a temperature"


def has_channel(context: SimulationContext, thermal: bool) -> bool:
    """Return whether a channel varies: a temperature if ``thermal``, otherwise any other signal."""
    return _name(context, thermal) is not None


def channel(context: SimulationContext, thermal: bool) -> Signal:
    """Return the first such channel; a temperature relative to its first value, as its zero is arbitrary.

    The first value is that of the first recording.
    """
    name = _find(context, thermal)
    signal = context.channels[name]
    return signal - (context.whole or context).channels[name][0] if thermal else signal


def channel_unit(context: SimulationContext, thermal: bool) -> str:
    """Return the unit of the channel; "1" if it has none."""
    return context.units[_find(context, thermal)] or "1"


def channel_range(context: SimulationContext, thermal: bool) -> float:
    """Return the difference between the largest and the smallest value of the channel."""
    return float(np.ptp(channel(context, thermal)))


def _find(context: SimulationContext, thermal: bool) -> str:
    name = _name(context, thermal)
    if name is None:
        what = f"in {', '.join(TEMPERATURES)}" if thermal else "that is not a temperature"
        raise RecordError(f"an effect of the simulation needs a channel {what} that varies: give its column")
    return name


def _name(context: SimulationContext, thermal: bool) -> str | None:
    # A channel that varies in one recording may be constant in another one.
    whole = context.whole or context
    return next(
        (
            name
            for name, signal in whole.channels.items()
            if (context.units[name] in TEMPERATURES) == thermal and np.ptp(signal) > 0.0
        ),
        None,
    )
