"""The scale of a rate: what the input moves in a second."""

import numpy as np

from islands.discrepancy.effect import Scene


def rate_of(scene: Scene) -> float:
    """Return the standard deviation of the input's rate, per second."""
    return float(np.std(np.diff(scene.u))) / scene.dt or 1.0
