"""Effects that a record resolves: they change its output visibly, and their strength is not zero."""

import numpy as np
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, estimate_covariance
from islands.diagnosis.calibration.resolution import DITHERED_RMS, is_unresolved
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.hypothesis import Hypothesis, without_effect
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect, Site
from islands.simulators.extended import ExtendedSimulator

#: Probability that the confidence region of a strength contains it.
REGION_PROBABILITY = 0.95


def remove_unresolved(hypothesis: Hypothesis, target: Target) -> Hypothesis:
    """Remove effects, the least important first, that a record does not resolve.

    The output changes by less than the resolution of the record if the simulation is fitted without them, or
    their strength may be zero.
    """
    for effect in hypothesis.effects[::-1]:
        fit = hypothesis.fit
        if not _may_be_zero(fit, effect, estimate_covariance(fit, target)):
            if fit.mean_square**0.5 >= DITHERED_RMS * target.resolution:
                continue
            change = (without_effect(hypothesis, effect, target).fit.output - fit.output)[: target.fitted]
            if not is_unresolved(change, target.resolution):
                continue
        hypothesis = without_effect(hypothesis, effect, target)
    return hypothesis


def _may_be_zero(fit: CalibrationResult, effect: Effect, covariance: Signal) -> bool:
    """Return whether the confidence region of the strengths of an effect contains that without the effect.

    The shape of the effect, as the time constant of a creep, is given: without it, a short record that shows
    the effect determines its strength less than its response. Of an effect without a strength all values
    count: one limit of a range may not be reached. A free form has none: a gain of the simulation may make
    up for the size of all of its values. The response to a value that jumps has no derivative, nor has that
    to an effect in front of an actuator that jumps.
    """
    if effect.is_free or effect.centre is not None or _is_before_jumps(effect, fit.simulation):
        return False
    part = fit.simulation.get_slice(effect)
    parameters = effect.parameters(fit.simulation.context)
    count = effect.linear_parameters or len(parameters)
    places, shape = slice(part.start, part.start + count), slice(part.start + count, part.stop)
    mixed = covariance[places, shape]
    given = mixed @ np.linalg.pinv(covariance[shape, shape], hermitian=True) @ mixed.T
    return may_be_zero(
        fit.values[places] - [each.nominal for each in parameters[:count]], covariance[places, places] - given
    )


def _is_before_jumps(effect: Effect, simulation: ExtendedSimulator) -> bool:
    """Return whether an effect changes the input of an actuator that moves in jumps."""
    maps = [each for each in simulation.effects if each.site == Site.INPUT]
    return effect in maps and any(each.centre is not None for each in maps[maps.index(effect) + 1 :])


def may_be_zero(values: Signal, covariance: Signal) -> bool:
    """Return whether the joint confidence region of values contains zero.

    Parameters
    ----------
    values : ndarray, shape (values,)
    covariance : ndarray, shape (values, values)
    """
    size = values.size / 2.0
    deviation = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    scaled = values / deviation
    correlation = covariance / np.outer(deviation, deviation)
    distance = float(scaled @ np.linalg.pinv(correlation, hermitian=True) @ scaled)
    return distance < 2.0 * float(scipy.special.gammaincinv(size, REGION_PROBABILITY))
