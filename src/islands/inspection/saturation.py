"""Saturation: flat extremes of a signal, where a sensor, a converter or an actuator is at its limit."""

import numpy as np
from numpy.typing import NDArray

from islands.inspection.channel import Channel, describe_amount
from islands.inspection.fact import Fact
from islands.inspection.quantisation import TWO

#: Consecutive samples of a flat extreme, and flat samples in all, at least.
_LEAST_RUN, _LEAST_SAMPLES = 3, 6

#: Samples at an extreme of a quantised signal, relative to those at the level next to it, at least. A sine,
#: whose peaks are flat in a coarse lattice, has 2.4 times as many.
_LEAST_RATIO = 4.0

#: Part of the increments that are zero, from which on a signal is held between steps.
_HELD = 0.4


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
    if has_two_levels or _is_held(values, step):
        state = "switched between two levels" if has_two_levels else "held between steps"
        text = f"{name} is {state}, so flat extremes are no sign of saturation."
        return Fact("saturation", name, None, "", None, None, text)
    found = {}
    for title, sign in (("maximum", 1.0), ("minimum", -1.0)):
        count = _count_flat(sign * values, step)
        if count:
            found[f"its {title} {describe_amount(sign * np.nanmax(sign * values), channel.unit)}"] = count
    share = sum(found.values()) / len(values)
    text = f"{name} has no flat extremes."
    if found:
        places = " and ".join(found)
        text = f"{name} is flat at {places} in {100 * share:.2g} % of the samples: it may be saturated."
    return Fact("saturation", name, share, "", None, None, text)


def _is_held(values: NDArray[np.float64], step: float) -> bool:
    """Return whether a signal is piecewise constant at several levels, not only slow in a coarse lattice."""
    increments = np.diff(values)
    still, moved = values[1:][increments == 0.0], np.abs(increments[increments != 0.0])
    if still.size < _HELD * increments.size:
        return False
    if step > 0.0 and np.nanmedian(moved) <= 1.5 * step:
        return False
    at_extremes = np.count_nonzero((still == np.nanmax(values)) | (still == np.nanmin(values)))
    levels = np.unique(values[np.isfinite(values)]).size
    return bool(at_extremes <= 0.9 * still.size or levels <= 0.02 * values.size)


def _count_flat(values: NDArray[np.float64], step: float) -> int:
    """Return the number of samples at the maximum, 0 if it is not flat."""
    top = np.nanmax(values)
    at_top = values >= top - 0.5 * step if step > 0.0 else values == top
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_top, [False]]).astype(np.int8)))
    lengths = edges[1::2] - edges[::2]
    count = int(lengths[lengths >= _LEAST_RUN].sum())
    if count < _LEAST_SAMPLES:
        return 0
    width = max(step, 0.005 * float(np.nanmax(values) - np.nanmin(values)))
    next_to_top = np.count_nonzero(
        (values < top - 0.5 * step) & (values >= top - 0.5 * step - width) & ~at_top
    )
    return count if count >= _LEAST_RATIO * next_to_top else 0
