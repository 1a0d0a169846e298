"""Separation of pairs of causes with given values, in different experiments."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np

from islands.diagnosis.planning.cause import Cause
from islands.diagnosis.planning.experiment import Experiment
from islands.diagnosis.planning.noise_free_fit import MAX_EVALUATIONS, fit_noise_free
from islands.diagnosis.planning.response_dictionary import ResponseDictionary
from islands.diagnosis.planning.separation import require_separation
from islands.effects.interface.context import Signal


@dataclass(frozen=True, slots=True, eq=False)
class CausePair:
    """Two causes to be separated, with the values that they have in all experiments."""

    one: Cause
    other: Cause

    @property
    def names(self) -> tuple[str, str]:
        """Names of both effects."""
        return self.one.effect.name, self.other.effect.name


@dataclass(frozen=True, slots=True)
class PairSeparation:
    """Expected separation of a pair, in the direction in which it is harder.

    Attributes
    ----------
    distance : float
        Square root of the expected minus twice log-likelihood ratio.
    required : float
        Distance that a diagnosis requires.
    """

    distance: float
    required: float

    @property
    def sufficiency(self) -> float:
        """Distance relative to the required one; the pair is separable from one on."""
        return self.distance / self.required if self.required else inf

    @property
    def expected_ratio(self) -> float:
        """Expected minus twice log-likelihood ratio."""
        return self.distance**2


def separate_pair(
    dictionary: ResponseDictionary, pair: CausePair, max_evaluations: int = MAX_EVALUATIONS
) -> PairSeparation:
    """Return how far an experiment separates a pair.

    Parameters
    ----------
    dictionary : ResponseDictionary
        Responses in the experiment.
    pair : CausePair
    max_evaluations : int
        Maximum number of evaluations of each fit. If it is not the default, fewer starting points are fitted.
    """
    found = [
        _separate(dictionary, truth, other, max_evaluations)
        for truth, other in ((pair.one, pair.other), (pair.other, pair.one))
    ]
    return min(found, key=lambda each: each.sufficiency)


def _separate(
    dictionary: ResponseDictionary, truth: Cause, other: Cause, max_evaluations: int
) -> PairSeparation:
    required = require_separation(dictionary.experiment, truth.effect, other.effect)
    observed = _simulate(dictionary, truth)
    if not np.isfinite(observed).all():
        return PairSeparation(0.0, required)  # an input on which the cause diverges is no experiment
    model = dictionary.get_model(other.effect)
    starts = dictionary.find_starts(other.effect, observed)
    if max_evaluations < MAX_EVALUATIONS:
        starts = starts[:1]
    starts.append(model.insert(other.effect, other.values))
    without = dictionary.without
    fits = [
        fit_noise_free(model, observed, starts, max_evaluations),
        fit_noise_free(without, observed, [without.output.nominal], max_evaluations),
    ]
    squared = min(fit.squared_distance for fit in fits)
    return PairSeparation(sqrt(squared) if isfinite(squared) else 0.0, required)


def _simulate(dictionary: ResponseDictionary, cause: Cause) -> Signal:
    model = dictionary.get_model(cause.effect)
    observed: Signal = model.simulate(model.insert(cause.effect, cause.values)[None])[0]
    return observed


def separate_pairs(
    experiment: Experiment, pairs: Sequence[CausePair], max_evaluations: int = MAX_EVALUATIONS
) -> tuple[PairSeparation, ...]:
    """Return how far an experiment separates each of several pairs."""
    dictionary = ResponseDictionary(experiment)
    return tuple(separate_pair(dictionary, pair, max_evaluations) for pair in pairs)


def rate_separations(separations: Sequence[PairSeparation]) -> float:
    """Return the sufficiency of a single pair, or the number of separated pairs with parts of the others."""
    if len(separations) == 1:
        return separations[0].sufficiency
    return sum(min(each.sufficiency, 1.0) for each in separations)
