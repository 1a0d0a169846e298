"""Search for the instants at which effects or terms begin or end.

A calibration moves an instant by the duration of its change only, so that it ends near its starting point.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from islands.diagnosis.calibration.intersample_selection import MIN_IMPROVEMENT
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.target import Target


class Instant(NamedTuple):
    """An instant among the values of a simulation.

    Attributes
    ----------
    place : int
        Its index.
    earliest, latest : float
        Bounds in seconds.
    first, last : float
        Distances of the first move and of the last one in seconds, as bounds.
    """

    place: int
    earliest: float
    latest: float
    first: float
    last: float


def move_instants(fit: CalibrationResult, target: Target, instants: Sequence[Instant]) -> CalibrationResult:
    """Return a fit with other instants, as long as these fit better; the distance of the moves is halved."""
    for each in instants:
        distance = each.first
        while distance > each.last:
            moved = np.tile(fit.values, (2, 1))
            moved[:, each.place] += [-distance, distance]
            moved[:, each.place] = np.clip(moved[:, each.place], each.earliest, each.latest)
            fits = [evaluate_fit(fit.simulation, target, values) for values in moved]
            best = min(fits, key=lambda one: one.score)
            if best.score < fit.score - MIN_IMPROVEMENT:
                # Each move gains, so that the search ends; a calibration of whitened errors may score worse.
                again = calibrate(best.simulation, target, best.values)
                fit = again if again.score < best.score else best
            else:
                distance /= 2.0
    return fit
