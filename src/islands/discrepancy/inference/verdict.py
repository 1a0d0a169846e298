"""The decision: whether an explanation may be called one, and how sure each of its names is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    Target,
    covariance,
    evaluate_fit,
)
from islands.discrepancy.inference.confounders import Confounder, find_confounder
from islands.discrepancy.inference.holdout import measure_holdout_gain
from islands.discrepancy.inference.hypothesis import (
    Alternatives,
    Hypothesis,
    find_alternatives,
    without_effect,
)
from islands.discrepancy.inference.screening import ScreenedEffect
from islands.discrepancy.inference.stepwise_search import LEAST
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.parallel import ParallelMap

#: Share of the explainable misfit that names have to explain, and from which on a remainder is no more than
#: one.
SHARE, MOST = 0.5, 0.9

#: Names within so much of the best cannot be told from it, and confidences are so many times cooler than
#: scores: untempered they say 0.97 where 0.72 is true.
EQUIVALENT, TEMPER = 9.0, 2.0

#: Part of what a cause does beside, which no simulation is in step with, that every further name has to
#: explain.
BESIDE = 0.1


class Verdict(StrEnum):
    """What an analysis comes to."""

    NOTHING = "nothing"
    NAMED = "named"
    REMAINDER = "named with remainder"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter that was found.

    Attributes
    ----------
    value : float
    unit : str
    ci95 : tuple of float or None
        Where it lies with 95 percent probability, if the simulation is right; None where nothing tells.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Finding:
    """A cause that was named.

    Attributes
    ----------
    name, family : str
        Of the catalogue.
    confidence : float
        Among the causes that would explain the same, from 0 to 1.
    equivalents : tuple of str
        Names that this record cannot tell from it.
    parameters : mapping of str to Value
    score : float
        What it gains, in minus twice the log-likelihood, its values paid for.
    explained_fraction : float or None
        Share of the explainable misfit that goes with it; None for what is no misfit of the mean.
    """

    name: str
    family: str
    confidence: float
    equivalents: tuple[str, ...]
    parameters: Mapping[str, Value]
    score: float
    explained_fraction: float | None


def validate_out_of_sample(
    found: Hypothesis, base: CalibrationResult, target: Target, fitted: int, rng: np.random.Generator
) -> Hypothesis:
    """Leave out what does not foretell samples that were not fitted: without that gain there is no name.

    Beside a cause that no simulation is in step with, leave out what may be a part of that.
    """
    while found.effects:
        before = reference_variance(found, base, target)
        if measure_holdout_gain(before, before is not base, found.fit, target, fitted, rng) > 0.0:
            break
        found = without_effect(found, found.effects[-1], target)
    beside = _beside(found, target)
    for effect in found.effects[:0:-1] if beside else ():
        without = without_effect(found, effect, target)
        less = without.fit.mean_square - found.fit.mean_square
        if less < BESIDE * beside and effect.family != "scale":
            found = without
    return found


def _beside(found: Hypothesis, target: Target) -> float:
    """Return the mean square of what causes do beside that no simulation is in step with."""
    others = (find_confounder(found.fit, effect, target) for effect in found.effects)
    return sum(other.beside for other in others if other is not None and other.gained > LEAST)


def reference_variance(found: Hypothesis, base: CalibrationResult, target: Target) -> CalibrationResult:
    """Return what an explanation is held against: the simulation, calibrated.

    Calibration takes up a gain, or a parameter that is off: these are held against the simulation as given.
    """
    if all(effect.family == "scale" for effect in found.effects):
        return evaluate_fit(base.simulation, target, base.simulation.nominal)
    return base


def explained_fraction(before: CalibrationResult, after: CalibrationResult, floor: float) -> float:
    """Return the share of the explainable misfit that is gone; ``floor`` is the noise's mean square."""
    misfit = before.mean_square - floor
    if misfit <= 0.0:
        return 0.0
    return float(np.clip((before.mean_square - after.mean_square) / misfit, 0.0, 1.0))


def classify(explained: float, named: bool, remains: bool, by_misfit: bool) -> Verdict:
    """Return the verdict on names that explain a share, where something remains or not.

    By misfit a form that is wrong may remain: a share of more than half is all that is asked for.
    """
    if not named:
        return Verdict.UNKNOWN if remains or by_misfit else Verdict.NOTHING
    if explained < (MOST if remains and not by_misfit else SHARE):
        return Verdict.UNKNOWN
    return Verdict.REMAINDER if remains else Verdict.NAMED


def describe_effects(
    found: Hypothesis,
    base: CalibrationResult,
    first: Sequence[ScreenedEffect],
    target: Target,
    effects: Sequence[Effect],
    floor: float,
    spread: ParallelMap = map,
) -> tuple[tuple[Finding, ...], tuple[ScreenedEffect, ...]]:
    """Say what was found, and which other rungs could stand in the place of one.

    Each effect is taken out, and all others are tried in its place.

    Parameters
    ----------
    base, first : CalibrationResult, sequence of ScreenedEffect
        The simulation alone and its ladder: what is left, and has been tried, where one effect was found.
    """
    named, instead = [], []
    deviations = np.sqrt(np.maximum(np.diag(covariance(found.fit, target)), 0.0))
    if len(found.effects) == 1:
        rivals: Sequence[Alternatives] = (Alternatives(Hypothesis(base, base.score, ()), first),)
    else:
        rivals = found.alternatives or find_alternatives(found, target, effects, spread)
    for effect, each in zip(found.effects, rivals, strict=True):
        without, rungs = each.without, each.screened
        scores = {rung.effect.cause: rung.score_gain(without.fit) for rung in reversed(rungs)}
        own = max(scores.get(effect.cause, 0.0), without.cost - found.cost)
        scores[effect.cause] = own
        name, family, values = effect.cause, effect.family, _values(found.fit, effect, deviations)
        if (other := find_confounder(found.fit, effect, target)) is not None:
            scores[other.effect.cause] = own + other.gained
            if other.gained > 0.0:
                name, family = other.effect.cause, other.effect.family
                values = _times(other, values, found.fit)
        equal = {each for each, score in scores.items() if score > scores[name] - EQUIVALENT} - {name}
        instead += [rung for rung in rungs if rung.effect.cause in equal]
        named.append(
            Finding(
                name,
                family,
                _confidence(scores[name], scores),
                tuple(sorted(equal, key=lambda name: -scores[name])),
                values,
                scores[name],
                explained_fraction(reference_variance(found, without.fit, target), found.fit, floor),
            )
        )
    return tuple(named), tuple(instead)


def _confidence(own: float, scores: Mapping[str, float]) -> float:
    rivals = (*scores.values(), 0.0)  # and nothing at all
    return 1.0 / sum(float(np.exp(min(score - own, 0.0) / (2 * TEMPER))) for score in rivals)


def _times(other: Confounder, values: Mapping[str, Value], fit: CalibrationResult) -> Mapping[str, Value]:
    """Return the values of a cause in the place of one that it is like."""
    parameters = other.effect.parameters(fit.simulation.context)
    found = {}
    for parameter, each in zip(parameters, values.values(), strict=True):
        low, high = each.ci95 or (each.value, each.value)
        reach = None if each.ci95 is None else (other.factor * low, other.factor * high)
        found[parameter.name] = Value(other.factor * each.value, parameter.unit, reach)
    return found


def _values(fit: CalibrationResult, effect: Effect, deviations: Signal) -> Mapping[str, Value]:
    part = fit.simulation.get_slice(effect)
    found = {}
    for place in range(part.start, part.stop):
        parameter, value = fit.simulation.parameters[place], float(fit.values[place])
        reach = 1.96 * float(deviations[place])
        found[parameter.name] = Value(value, parameter.unit, (value - reach, value + reach))
    return found
