"""Saturation: flat extremes of a signal, where a sensor, a converter or an actuator is at its limit."""

import numpy as np

from islands.records.flat_extremes import TWO, count_flat, is_held
from islands.records.inspection.channel import Channel, describe_amount
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
        state = "switched between two levels" if has_two_levels else "held between steps"
        text = f"{name} is {state}, so flat extremes are no sign of saturation."
        return Fact("saturation", name, None, "", None, None, text)
    found = {}
    for title, sign in (("maximum", 1.0), ("minimum", -1.0)):
        count = count_flat(sign * values, step)
        if count:
            found[f"its {title} {describe_amount(sign * np.nanmax(sign * values), channel.unit)}"] = count
    share = sum(found.values()) / len(values)
    text = f"{name} has no flat extremes."
    if found:
        places = " and ".join(found)
        text = f"{name} is flat at {places} in {100 * share:.2g} % of the samples: it may be saturated."
    return Fact("saturation", name, share, "", None, None, text)
