"""Curve through equally spaced values, a cubic between neighbours (Catmull and Rom, 1974)."""

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: Number of values of a curve between the ends of its range, where it is zero.
VALUES = 7

#: Places of the values of a curve in its range. The straight line through its ends is a gain and an offset,
#: which are not part of the curve (terminal-based linearity).
PLACES = np.linspace(-1.0, 1.0, VALUES + 2)[1:-1]


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


def write_curve(place: str) -> str:
    """Write a curve as an expression: a sum of cubics, each from one value on.

    Parameters
    ----------
    place : str
        Expression of the place in the range from -1 to 1. The values are ``n0``, ``n1``, and so on.
    """
    # Each row has the weights of all values: a value, its neighbours, and the slopes and cubics between them.
    heights = np.zeros((VALUES + 4, VALUES))
    heights[2:-2] = np.eye(VALUES)
    heights[0], heights[-1] = heights[3] - 3.0 * heights[2], heights[-4] - 3.0 * heights[-3]
    slopes, rises = 0.5 * (heights[2:] - heights[:-2]), np.diff(heights[1:-1], axis=0)
    squares = 3.0 * rises - 2.0 * slopes[:-1] - slopes[1:]
    cubes = slopes[:-1] + slopes[1:] - 2.0 * rises
    # The changes of both at each value; the curve begins with zero at the lower end.
    squares[1:], cubes[1:] = np.diff(squares, axis=0) - 3.0 * cubes[:-1], np.diff(cubes, axis=0)

    def weigh(row: NDArray[np.float64]) -> str:
        terms = [f"({weight})*n{index}" for index, weight in enumerate(row) if weight]
        return f"({' + '.join(terms) or '0'})"

    position = f"min(max((({place}) + 1)*{0.5 * (VALUES + 1)}, 0), {VALUES + 1})"
    parts = [f"{position}*{weigh(slopes[0])}"]
    for index, (square, cube) in enumerate(zip(squares, cubes, strict=True)):
        behind = f"max({position} - {index}, 0)"
        parts.append(f"{behind}**2*({weigh(square)} + {behind}*{weigh(cube)})")
    return " + ".join(parts)


@kernel
def _interpolate_all(places, values, found):
    for k in range(places.size):
        found[k] = interpolate(places[k], values)


def interpolate_curve(places, values):
    """Return the values of a curve at places (samples,) of its range from -1 to 1."""
    found = np.empty(places.size)
    _interpolate_all(np.ascontiguousarray(places), np.ascontiguousarray(values), found)
    return found
