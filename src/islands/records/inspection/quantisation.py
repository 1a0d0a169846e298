"""Quantisation: the step of a lattice that contains all values of a signal."""

import numpy as np

from islands.records.flat_extremes import TWO, count_levels, find_step, is_held
from islands.records.inspection.channel import Channel
from islands.records.inspection.fact import Fact
from islands.sentences import write_amount


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
    finding = "quantisation_steps"
    if count == TWO:
        finding, step = "quantisation_two_levels", None
    elif step is None:
        finding = "quantisation_none"
    elif is_held(channel.values, step):
        finding, step = "quantisation_held", None
    details = {"levels": count, "ends": [write_amount(level, channel.unit) for level in levels[[0, -1]]]}
    return Fact("quantisation", name, finding, step, channel.unit, details=details)
