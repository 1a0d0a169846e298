"""Quantisation: the step of a lattice that contains all values of a signal."""

import numpy as np

from islands.records.flat_extremes import TWO, count_levels, find_step, is_held
from islands.records.inspection.channel import Channel, describe_amount
from islands.records.inspection.fact import Fact


def find_quantisation(channel: Channel) -> Fact:
    """Return the step of the lattice that contains all values of a signal.

    Returns
    -------
    Fact
        The value is None if there is no such lattice, if it has more than 65 536 levels in the range, if the
        signal has two levels, which every lattice of their distance contains, or if it is held between steps:
        the levels of an excitation are chosen, and are not those of a converter.
    """
    levels, name = np.unique(channel.known), channel.name
    step, count = find_step(levels), count_levels(levels)
    ends = [describe_amount(level, channel.unit) for level in levels[[0, -1]]]
    if count == TWO:
        text, step = f"{name} has two levels, {ends[0]} and {ends[1]}.", None
    elif step is None:
        text = f"{name} is not quantised."
    elif is_held(channel.values, step):
        text, step = f"{name} is held at {count} levels from {ends[0]} to {ends[1]}.", None
    else:
        text = f"{name} has {count} levels in steps of {describe_amount(step, channel.unit)}."
    return Fact("quantisation", name, step, channel.unit, None, None, text)
