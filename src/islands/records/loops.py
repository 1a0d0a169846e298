"""Loops of the output over the input."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset

#: Fewest samples of a loop that is visible in a figure.
_MIN_SAMPLES = 20

#: Largest path of the input in a loop, in multiples of the shortest, twice its range. Above it the input
#: turns so often that there is no single loop.
_MAX_PATH = 2.0

#: Smallest enclosed area, as a fraction of the rectangle around the loop.
_MIN_AREA = 0.01


def loop_starts(record: Dataset) -> NDArray[np.int64]:
    """Return the samples at which loops start: the first varying input rises through its mean.

    A rise must lead from a quarter of the standard deviation below the mean to a quarter above it, so that
    noise on a slow input does not create loops.
    """
    u = record.u[:, int(np.argmax(np.ptp(record.u, axis=0) > 0))]
    u = u - u.mean()
    away = np.flatnonzero(np.abs(u) > 0.25 * u.std())
    rises = np.flatnonzero(np.diff(np.sign(u[away])) > 0)
    return away[rises + 1]


def has_loops(record: Dataset) -> bool:
    """Return whether the output over the first varying input is a loop.

    Half of the loops or more must have at least 20 samples, an input that rises and falls about once, and an
    enclosed area of at least 1 % of the rectangle around them. The output of a static system encloses no
    area, and an input such as white noise does not rise and fall slowly enough.
    """
    u = record.u[:, int(np.argmax(np.ptp(record.u, axis=0) > 0))]
    starts = loop_starts(record)
    loops = [slice(int(first), int(last) + 1) for first, last in pairwise(starts)]
    visible = [_is_visible(u[loop], record.y[loop]) for loop in loops]
    return bool(visible) and 2 * sum(visible) >= len(visible)


def _is_visible(u: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    width, height = np.ptp(u), np.ptp(y)
    if len(u) < _MIN_SAMPLES or not np.isfinite(height) or height == 0.0:
        return False
    path = float(np.add.reduce(np.abs(np.diff(u))))
    return bool(path <= _MAX_PATH * 2.0 * width) and measure_area(u, y) >= _MIN_AREA


def measure_area(u: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Return the area that output over input encloses, as a fraction of the rectangle around it.

    Parameters
    ----------
    u, y : ndarray, shape (samples,)
        One loop of signals that vary; the last sample is connected with the first.
    """
    # Half the sum of cross products around the closed polygon.
    x, z = (u - u[0]) / np.ptp(u), (y - y[0]) / np.ptp(y)
    return 0.5 * abs(float(np.add.reduce(x * np.roll(z, -1) - np.roll(x, -1) * z)))
