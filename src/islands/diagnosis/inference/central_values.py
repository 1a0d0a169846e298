"""Values of effects that jump are set to the middle of those that a record does not tell apart."""

from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.curve_ends import MAX_INCREASE
from islands.diagnosis.inference.hypothesis import Hypothesis


def centre_values(hypothesis: Hypothesis, target: Target) -> Hypothesis:
    """Set the values of effects that jump to the middle of those with the same response, and fit all others.

    An effect whose likelihood would be lower by more than an interval of 95 % keeps its values: other effects
    change its input.
    """
    fit = hypothesis.fit
    for effect in hypothesis.effects:
        if effect.centre is None:
            continue
        part, start = fit.simulation.get_slice(effect), fit.values.copy()
        start[part] = effect.centre(fit.values[part], fit.simulation.context)
        is_fixed = np.zeros(start.size, dtype=np.bool_)
        is_fixed[part] = True
        centred = calibrate(fit.simulation, target, start, is_fixed=is_fixed)
        if centred.score < fit.score + MAX_INCREASE:
            fit = centred
    cost = hypothesis.cost + fit.score - hypothesis.fit.score
    return replace(hypothesis, fit=fit, cost=cost)
