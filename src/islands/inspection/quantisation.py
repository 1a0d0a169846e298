"""Quantisation: the step of a lattice that contains all values of a signal."""

import numpy as np
from numpy.typing import NDArray

from islands.inspection.channel import Channel, describe_amount
from islands.inspection.fact import Fact

#: Levels within the range of a signal, at most: those of a converter of 16 bits.
_MOST_LEVELS = 2.0**16

#: Fewest different values, and the part of them that may differ from the lattice by rounding.
_LEAST_VALUES, _ROUNDING = 3, 1e-3

#: Levels of a switched signal.
TWO = 2

#: Largest number of divisions of the Euclidean algorithm.
_DIVISIONS = 40


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
    step = _find_step(levels)
    if step is None:
        text = f"{channel.name} is not quantised."
        return Fact("quantisation", channel.name, None, channel.unit, None, None, text)
    count = 1 + round((levels[-1] - levels[0]) / step)
    text = f"{channel.name} is quantised in steps of {describe_amount(step, channel.unit)}: {count} levels."
    return Fact("quantisation", channel.name, step, channel.unit, None, None, text)


def _find_step(levels: NDArray[np.float64]) -> float | None:
    """Return the largest step of which all differences of some sorted levels are multiples."""
    if levels.size < _LEAST_VALUES:
        return None
    least = (levels[-1] - levels[0]) / _MOST_LEVELS
    differences = np.diff(levels)
    # Values that differ by rounding only are one level.
    differences = differences[differences > _ROUNDING * least]
    step = float(differences.min())
    for _ in range(_DIVISIONS):
        if step < 0.99 * least:
            return None
        remainders = np.abs(differences - step * np.round(differences / step))
        far = remainders[remainders > _ROUNDING * step]
        if not far.size:
            return _fit_step(levels, step)
        step = float(far.min())
    return None


def _fit_step(levels: NDArray[np.float64], step: float) -> float | None:
    """Return the step by least squares; None if the levels are too far from its multiples."""
    places = np.round((levels - levels[0]) / step)
    centred = places - places.mean()
    fitted = float(np.sum(centred * (levels - levels.mean())) / np.sum(centred**2))
    errors = levels - levels.mean() - fitted * centred
    return fitted if np.abs(errors).max() <= 0.01 * fitted else None
