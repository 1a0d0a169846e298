"""Separation of two causes: the expected log-likelihood ratio, and the one that a diagnosis requires.

The ratio of noisy data is normally distributed about the expected one d^2, with the standard deviation 2 d
(Kay, Fundamentals of Statistical Signal Processing: Detection Theory, section 4.3). Causes are separable if
it exceeds the margin of the diagnosis with a probability of `PROBABILITY`.
"""

from math import log, sqrt

import scipy

from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.planning.experiment import Experiment
from islands.effects.interface.effect import Effect

#: Probability with which the ratio exceeds the margin of detection or separation.
PROBABILITY = 0.9

#: Probability that the best of all effects is detected by chance.
_FALSE_ALARM_PROBABILITY = 0.01


def require_distance(margin: float) -> float:
    """Return the distance d with a ratio that exceeds the margin with a probability of `PROBABILITY`.

    Parameters
    ----------
    margin : float
        Margin in minus twice the log-likelihood; negative if the other cause has more parameters.

    Returns
    -------
    float
        Distance in standard deviations of the noise: the solution of ``d^2 - 2 z d = margin``.
    """
    z = float(scipy.stats.norm.isf(1.0 - PROBABILITY))
    return max(z + sqrt(z**2 + margin), 0.0) if z**2 + margin > 0.0 else 0.0


def require_detection(experiment: Experiment, effect: Effect, effect_count: int) -> float:
    """Return the distance from the simulation without effects at which an effect is detected.

    Its gain must exceed the penalty of the information criterion, and what noise gains by chance.
    """
    freedom = _count_freedom(experiment, effect)
    by_chance = float(scipy.stats.chi2.isf(_FALSE_ALARM_PROBABILITY / effect_count, freedom))
    return require_distance(max(_compute_penalty(experiment, effect) + MIN_GAIN, by_chance))


def require_separation(experiment: Experiment, effect: Effect, other: Effect) -> float:
    """Return the distance from another effect at which an effect is not an equivalent of it."""
    penalty = _compute_penalty(experiment, effect) - _compute_penalty(experiment, other)
    return require_distance(EQUIVALENCE_MARGIN + penalty)


def _compute_penalty(experiment: Experiment, effect: Effect) -> float:
    return _count_freedom(experiment, effect) * log(experiment.estimation_samples)


def _count_freedom(experiment: Experiment, effect: Effect) -> int:
    return len(effect.parameters(experiment.context)) + effect.extra_degrees_of_freedom
