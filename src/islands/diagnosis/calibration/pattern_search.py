"""Pattern search for values that the error is no smooth function of (Hooke and Jeeves, 1961).

A calibration moves an instant by the duration of its change only, and a step of an actuator by the width of a
ramp between two levels. Both end near their starting points, and other effects make up for the rest.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from islands.diagnosis.calibration.intersample_selection import MIN_IMPROVEMENT
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, compare_output
from islands.diagnosis.calibration.target import Target

#: `Coordinate.largest` and `Coordinate.smallest` of the values of a map that jumps, relative to its width.
LARGEST_MOVE, SMALLEST_MOVE = 0.005, 1e-5

#: The largest one of an offset. It moves all levels alike, and a width the outer ones by many times as much.
LARGEST_OFFSET_MOVE = 0.08


class Coordinate(NamedTuple):
    """A value of a simulation that is searched for.

    Attributes
    ----------
    place : int
        Its index.
    lower, upper : float
        Bounds.
    largest, smallest : float
        Size of the largest move, which is halved again and again, and the size at which that ends.
    """

    place: int
    lower: float
    upper: float
    largest: float
    smallest: float


def search_pattern(
    fit: CalibrationResult, target: Target, coordinates: Sequence[Coordinate]
) -> CalibrationResult:
    """Return a fit with other values, each moved by the best of several sizes as long as that fits better.

    A value that was moved makes up for an error of the next one, so that all of them are moved again.
    """
    best = fit
    for at in coordinates:
        best = _move(best, target, at)
    return best if best is fit or len(coordinates) == 1 else search_pattern(best, target, coordinates)


def _move(fit: CalibrationResult, target: Target, at: Coordinate) -> CalibrationResult:
    """Move one value by the best of several sizes as long as that fits better."""
    sizes = at.largest * 0.5 ** np.arange(np.ceil(np.log2(at.largest / at.smallest)))
    moves = np.concatenate([-sizes, sizes])
    while moves.size:
        moved = np.tile(fit.values, (moves.size, 1))
        moved[:, at.place] = np.clip(moved[:, at.place] + moves, at.lower, at.upper)
        outputs = fit.simulation.simulate_batch(moved)
        fits = [compare_output(fit.simulation, target, *each) for each in zip(moved, outputs, strict=True)]
        best = min(fits, key=lambda one: one.score)
        if not best.score < fit.score - MIN_IMPROVEMENT:
            break
        # Each move gains, so that the search ends; a calibration of whitened errors may score worse.
        again = calibrate(best.simulation, target, best.values)
        fit = again if again.score < best.score else best
    return fit


def search_jumps(fit: CalibrationResult, target: Target) -> CalibrationResult:
    """Return a fit with better values of its maps that jump, a quantiser and stick-slip."""
    coordinates = []
    for effect in fit.simulation.effects:
        part = fit.simulation.get_slice(effect)
        width = float(fit.values[part.start])
        if effect.centre is not None and width > 0.0:
            for place, parameter in enumerate(fit.simulation.parameters[part], start=part.start):
                largest = LARGEST_MOVE if place == part.start else LARGEST_OFFSET_MOVE
                moves = largest * width, SMALLEST_MOVE * width
                coordinates.append(Coordinate(place, parameter.lower, parameter.upper, *moves))
    return search_pattern(fit, target, coordinates)
