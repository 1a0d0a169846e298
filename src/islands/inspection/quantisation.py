"""Quantisation: the step of a lattice that contains all values of a signal."""

import numpy as np

from islands.data.flat_extremes import TWO, find_step
from islands.inspection.channel import Channel, describe_amount
from islands.inspection.fact import Fact


def find_quantisation(channel: Channel) -> Fact:
    """Return the step of the lattice that contains all values of a signal.

    Returns
    -------
    Fact
        The value is None if there is no such lattice, if it has more than 65 536 levels in the range, or if
        the signal has two levels, which every lattice of their distance contains.
    """
    levels = np.unique(channel.known)
    if levels.size == TWO:
        low, high = (describe_amount(level, channel.unit) for level in levels)
        text = f"{channel.name} has two levels, {low} and {high}."
        return Fact("quantisation", channel.name, None, channel.unit, None, None, text)
    step = find_step(levels)
    if step is None:
        text = f"{channel.name} is not quantised."
        return Fact("quantisation", channel.name, None, channel.unit, None, None, text)
    count = 1 + round((levels[-1] - levels[0]) / step)
    text = f"{channel.name} is quantised in steps of {describe_amount(step, channel.unit)}: {count} levels."
    return Fact("quantisation", channel.name, step, channel.unit, None, None, text)
