"""Saturation: flat extremes of a signal, where a sensor, a converter or an actuator is at its limit."""

import numpy as np

from islands.records.flat_extremes import TWO, count_flat, is_held
from islands.records.inspection.channel import Channel
from islands.records.inspection.fact import Fact


def find_saturation(channel: Channel, quantisation: Fact) -> Fact:
    """Return the part of the samples at a flat maximum or minimum, 0 if neither is flat.

    Parameters
    ----------
    channel : Channel
    quantisation : Fact
        Quantisation of the signal: peaks of a quantised signal are flat, too.

    Returns
    -------
    Fact
        The value is None for a signal that is held between steps or has two levels: all its levels are flat.
    """
    values, name = channel.values, channel.name
    step = float(quantisation.value or 0.0)
    has_two_levels = np.unique(channel.known).size == TWO
    if has_two_levels or is_held(values, step):
        return Fact("saturation", name, "saturation_switched" if has_two_levels else "saturation_held")
    counts = {
        (title, float(sign * np.nanmax(sign * values))): count
        for title, sign in (("maximum", 1.0), ("minimum", -1.0))
        if (count := count_flat(sign * values, step))
    }
    share = sum(counts.values()) / len(values)
    finding = "saturation_flat" if counts else "saturation_none"
    details = {"places": tuple(counts), "signal_unit": channel.unit}
    return Fact("saturation", name, finding, share, details=details)
