"""Channels that were recorded beside the output: a temperature by its unit, or a neighbour's signal."""

import numpy as np

from islands.discrepancy.interfaces.effect import Signal, SimulationContext

#: Units of temperatures.
TEMPERATURES = ("K", "degC", "C", "°C", "mK", "degF")


def has_channel(scene: SimulationContext, thermal: bool) -> bool:
    """Tell whether a channel was recorded that is a temperature, or one that is none, and that moves."""
    return _name(scene, thermal) is not None


def channel(scene: SimulationContext, thermal: bool) -> Signal:
    """Return the channel; a temperature from its first value on, since its zero says nothing here."""
    signal = scene.channels[_name(scene, thermal) or ""]
    return signal - signal[0] if thermal else signal


def channel_unit(scene: SimulationContext, thermal: bool) -> str:
    """Return the channel's unit."""
    return scene.units[_name(scene, thermal) or ""] or "1"


def spread(scene: SimulationContext, thermal: bool) -> float:
    """Return how far the channel moves."""
    return float(np.ptp(channel(scene, thermal)))


def _name(scene: SimulationContext, thermal: bool) -> str | None:
    return next(
        (
            name
            for name, signal in scene.channels.items()
            if (scene.units[name] in TEMPERATURES) == thermal and np.ptp(signal) > 0.0
        ),
        None,
    )
