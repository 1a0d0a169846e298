"""Ends of free curves that a record does not determine are flattened: an extension applies them elsewhere."""

from collections.abc import Mapping

import numpy as np
from scipy.special import gammaincinv

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis

#: Free forms whose values are a curve over a signal or its rate.
CURVES = (
    "input-curve",
    "output-curve",
    "stiffness-curve",
    "damping-curve",
    "input-lag-curve",
    "output-lag-curve",
)

#: Largest number of values that are flattened at each end of a curve.
MAX_FLATTENED = 2

#: Increase of minus twice the log-likelihood at the ends of an interval of 95 %.
MAX_INCREASE = 2.0 * float(gammaincinv(0.5, 0.95))


def flatten_ends(hypothesis: Hypothesis, target: Target) -> Hypothesis:
    """Set the values at the ends of free curves to the neighbouring one, if the record allows it.

    It does if the likelihood of the simulation, fitted again, is as high within an interval of 95 %.
    """
    fit, tied = hypothesis.fit, dict[int, int]()
    for effect in hypothesis.effects:
        if effect.name in CURVES:
            part = fit.simulation.get_slice(effect)
            places = list(range(part.start, part.stop))
            for order in (places, places[::-1]):
                for count in range(1, MAX_FLATTENED + 1):
                    more = tied | dict.fromkeys(order[:count], order[count])
                    flat = _tie(fit, more, target)
                    if not flat.score < fit.score + MAX_INCREASE:
                        break
                    fit, tied = flat, more
    return hypothesis.with_fit(fit) if tied else hypothesis


def _tie(fit: CalibrationResult, tied: Mapping[int, int], target: Target) -> CalibrationResult:
    """Return a fit with some values equal to others, which are fitted."""
    values, ends = fit.values.copy(), list(tied)
    values[ends] = values[list(tied.values())]
    is_fixed = np.isin(np.arange(values.size), ends)
    values = calibrate(fit.simulation, target, values, is_fixed=is_fixed).values.copy()
    values[ends] = values[list(tied.values())]
    return evaluate_fit(fit.simulation, target, values)
