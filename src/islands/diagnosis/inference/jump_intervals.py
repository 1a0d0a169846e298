"""Confidence intervals of the values of effects that jump, which have no derivatives."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.curve_ends import MAX_INCREASE
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.diagnosis.inference.screening import transfer_parameters
from islands.effects.hysteresis import is_held
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, apply_map

#: Factors of a width that are compared, and changes of a distance relative to the width.
_CHANGES = np.geomspace(5e-4, 0.9, 32)
_FACTORS = np.concatenate([1.0 - _CHANGES[::-1], [1.0], 1.0 + _CHANGES])
_DISTANCES = np.linspace(-0.4, 0.4, 65)


def find_jump_intervals(
    fit: CalibrationResult, effect: Effect, target: Target
) -> tuple[tuple[float, float], ...] | None:
    """Return the 95 % intervals of the values of an effect that jumps; None if they are unknown.

    They are known if the input is held, as that of a valve. Another input passes a jump between two
    samples: the intervals, about a thousandth of the values, are smaller than the error of this response.

    The intervals are those of the profile likelihood: minus twice its logarithm exceeds the least one by no
    more than the quantile of the chi-square distribution (Venzon and Moolgavkar, Applied Statistics 37 (1988)
    87-94). The response of the plant to what the effect changes, and to its own parameters, is linear.

    Parameters
    ----------
    fit : CalibrationResult
        With the effect, a map of the input, and others.
    effect : Effect
        Its first value is a width, the others are distances.
    target : Target
    """
    simulation, part = fit.simulation, fit.simulation.get_slice(effect)
    context, values = simulation.context, fit.values[part]
    if values[0] <= 0.0 or not is_held(context.u):
        return None
    others = simulation.with_effects([each for each in simulation.effects if each is not effect])
    plant = evaluate_fit(others, target, transfer_parameters(fit.values, simulation, others))
    response = respond_to_pulse(plant)
    if response is None:
        return None
    is_own = np.zeros(fit.values.size, dtype=np.bool_)
    is_own[part] = True
    projection = Projection(fit, target, is_own)
    points = _list_points(values)
    moved = apply_map(effect, context.u, values, context)
    losses: dict[bytes, float] = {}
    keys = []
    for point in points:
        change = apply_map(effect, context.u, point, context) - moved
        keys.append(change.tobytes())
        if keys[-1] not in losses:
            remainder = projection.residual - projection(convolve(change, response, context.segments))
            losses[keys[-1]] = -projection.score_decrease(float(remainder @ remainder))
    most = min(losses.values()) + MAX_INCREASE
    is_likely = np.array([losses[key] < most for key in keys])
    return tuple(_find_range(column, is_likely) for column in points.T)


def _list_points(values: Signal) -> Signal:
    """Return values near those of an effect, shape (points, values)."""
    width, distances = values[0], values[1:]
    return np.array(
        [
            (width * factor, *(distances + width * np.array(moves)))
            for factor, *moves in product(_FACTORS, *[_DISTANCES] * distances.size)
        ]
    )


def _find_range(values: Signal, is_likely: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the range of the likely values, each with half of the distance to the next value."""
    compared, likely = np.unique(values), values[is_likely]
    limits = np.concatenate([compared[:1], (compared[1:] + compared[:-1]) / 2.0, compared[-1:]])
    first, last = np.searchsorted(compared, [likely.min(), likely.max()])
    return float(limits[first]), float(limits[last + 1])
