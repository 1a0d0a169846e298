"""Curve through equally spaced values, a cubic between neighbours (Catmull and Rom, 1974)."""

import numpy as np

from islands.kernels.jit_cache import kernel

#: Number of values of a curve between the ends of its range, where it is zero.
VALUES = 7


@kernel(inline="always")
def interpolate(place, values):
    """Interpolate a curve at one place of its range from -1 to 1; it is zero at the ends and outside.

    ``values`` are `VALUES` numbers, as an array or a pointer.
    """
    position = (place + 1.0) * (0.5 * (VALUES + 1))
    if not 0.0 < position < VALUES + 1:
        return 0.0
    index = int(position)
    f = position - index
    left = values[index - 1] if index > 0 else 0.0
    right = values[index] if index < VALUES else 0.0
    # At the ends, the slopes are those of the parabolas through three values.
    before = values[index - 2] if index > 1 else 0.0 if index == 1 else values[1] - 3.0 * right
    after = (
        values[index + 1]
        if index < VALUES - 1
        else 0.0
        if index == VALUES - 1
        else values[VALUES - 2] - 3.0 * left
    )
    first, last = 0.5 * (right - before), 0.5 * (after - left)
    return (
        (1.0 + 2.0 * f) * (1.0 - f) ** 2 * left
        + f * (1.0 - f) ** 2 * first
        + f * f * (3.0 - 2.0 * f) * right
        - f * f * (1.0 - f) * last
    )


@kernel
def _interpolate_all(places, values, found):
    for k in range(places.size):
        found[k] = interpolate(places[k], values)


def interpolate_curve(places, values):
    """Return the values of a curve at places (samples,) of its range from -1 to 1."""
    found = np.empty(places.size)
    _interpolate_all(np.ascontiguousarray(places), np.ascontiguousarray(values), found)
    return found
