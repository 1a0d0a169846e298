"""Channels that were recorded beside the output: a temperature by its unit, or a neighbour's signal."""

import numpy as np

from islands.discrepancy.interfaces.effect import Signal, SimulationContext

#: Units of temperatures.
TEMPERATURES = ("K", "degC", "C", "°C", "mK", "degF")


def has_channel(context: SimulationContext, thermal: bool) -> bool:
    """Tell whether a channel was recorded that is a temperature, or one that is none, and that moves."""
    return _name(context, thermal) is not None


def channel(context: SimulationContext, thermal: bool) -> Signal:
    """Return the channel; a temperature from its first value on, since its zero says nothing here."""
    signal = context.channels[_name(context, thermal) or ""]
    return signal - signal[0] if thermal else signal


def channel_unit(context: SimulationContext, thermal: bool) -> str:
    """Return the channel's unit."""
    return context.units[_name(context, thermal) or ""] or "1"


def spread(context: SimulationContext, thermal: bool) -> float:
    """Return how far the channel moves."""
    return float(np.ptp(channel(context, thermal)))


def _name(context: SimulationContext, thermal: bool) -> str | None:
    return next(
        (
            name
            for name, signal in context.channels.items()
            if (context.units[name] in TEMPERATURES) == thermal and np.ptp(signal) > 0.0
        ),
        None,
    )
