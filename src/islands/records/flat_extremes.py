"""Flat extremes of a signal, where a sensor, a converter or an actuator is at its limit (saturation).

A quantised signal is flat at its peaks, too, so that the step of its lattice is found first.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Levels within the range of a signal, at most: those of a converter of 16 bits.
_MOST_LEVELS = 2.0**16

#: Fewest different values, and the part of them that may differ from the lattice by rounding.
_LEAST_VALUES, _ROUNDING = 3, 1e-3

#: Levels of a switched signal.
TWO = 2

#: Largest number of divisions of the Euclidean algorithm.
_DIVISIONS = 40

#: Consecutive samples of a flat extreme, and flat samples in all, at least.
_LEAST_RUN, _LEAST_SAMPLES = 3, 6

#: Samples at an extreme of a quantised signal, relative to those at the level next to it, at least. A sine,
#: whose peaks are flat in a coarse lattice, has 2.4 times as many.
_LEAST_RATIO = 4.0

#: Part of the increments that are zero, from which on a signal is held between steps.
_HELD = 0.4


class SensorLimits(NamedTuple):
    """Least and greatest value that a sensor shows; None for an extreme that is not flat."""

    lower: float | None = None
    upper: float | None = None

    @property
    def range(self) -> tuple[float, float]:
        """Both limits, infinite without one."""
        lower = -np.inf if self.lower is None else self.lower
        return lower, np.inf if self.upper is None else self.upper

    def mirror(self, values: NDArray[np.float64]) -> "SensorLimits":
        """Return limits that are symmetric about zero; none if the values of the signal exceed them."""
        largest = max((abs(each) for each in self if each is not None), default=0.0)
        return NO_LIMITS if np.nanmax(np.abs(values)) > largest else SensorLimits(-largest, largest)

    def write(self, text: str, number: Callable[[float], str] = repr) -> str:
        """Return the expression of a signal within the limits, with these as ``number`` writes them."""
        if self.lower is not None:
            text = f"max({text}, {number(self.lower)})"
        return text if self.upper is None else f"min({text}, {number(self.upper)})"


#: Of a sensor that has none.
NO_LIMITS = SensorLimits()


def find_limits(values: NDArray[np.float64], bounds: Sequence[tuple[int, int]] | None = None) -> SensorLimits:
    """Return the flat extremes of a signal; none of one that is held between steps or has two levels.

    Parameters
    ----------
    values : ndarray, shape (samples,)
        NaN marks a missing value.
    bounds : sequence of (int, int), optional
        First sample of every recording and the sample after its last. The equal samples at the start of a
        recording are no flat extreme: the system may rest before its input moves.
    """
    levels = np.unique(values[np.isfinite(values)])
    step = find_step(levels) or 0.0
    if levels.size <= TWO or is_held(values, step):
        return NO_LIMITS
    moving = values.copy()
    for begin, end in bounds or ((0, len(values)),):
        moves = np.flatnonzero(values[begin:end] != values[begin])
        moving[begin : begin + moves[0] if moves.size else end] = np.nan
    lower, upper = (
        float(extreme) if np.any(moving == extreme) and count_flat(sign * moving, step) > 0 else None
        for sign, extreme in ((-1.0, levels[0]), (1.0, levels[-1]))
    )
    return SensorLimits(lower, upper)


def count_flat(values: NDArray[np.float64], step: float) -> int:
    """Return the number of samples at the maximum, 0 if it is not flat; ``step`` is that of the lattice."""
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


def is_held(values: NDArray[np.float64], step: float) -> bool:
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


def count_levels(values: NDArray[np.float64]) -> int:
    """Return how many levels a signal has; values that differ by rounding only are one level."""
    levels = np.unique(values[np.isfinite(values)])
    step = find_step(levels)
    return levels.size if step is None else np.unique(np.round((levels - levels[0]) / step)).size


def find_step(levels: NDArray[np.float64]) -> float | None:
    """Return the largest step of which all differences of some sorted levels are multiples.

    None if there is no such lattice, or if it has more than 65 536 levels in the range.
    """
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
