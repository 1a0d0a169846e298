"""Verdict: whether effects explain a residual, with which confidence, and which others explain it as well."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    Target,
    estimate_covariance,
    evaluate_fit,
)
from islands.discrepancy.inference.chance_gain import ForwardSelection, compute_chance_gain
from islands.discrepancy.inference.confounders import Confounder, find_confounder
from islands.discrepancy.inference.holdout import cross_validate_gain
from islands.discrepancy.inference.hypothesis import (
    Alternatives,
    Hypothesis,
    find_alternatives,
    without_effect,
)
from islands.discrepancy.inference.screening import ScreenedEffect, bic_penalty
from islands.discrepancy.inference.stepwise_search import MIN_GAIN
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.parallel import ParallelMap

#: Minimum fraction of the explainable misfit that the effects have to explain.
MIN_EXPLAINED_FRACTION = 0.5

#: The same if the residual still has structure: the rest is then small enough to be called a remainder.
MIN_EXPLAINED_FRACTION_WITH_REMAINDER = 0.9

#: Effects whose scores are within this margin of the named one cannot be distinguished from it.
EQUIVALENCE_MARGIN = 9.0

#: Temperature of the softmax from scores to confidences: without it, a confidence of 0.97 is right in 0.72 of
#: the cases.
CONFIDENCE_TEMPERATURE = 2.0

#: Minimum decrease of the mean square by each further effect, relative to the part of a confounder's response
#: that no simulation reproduces.
MIN_CONFOUNDED_FRACTION = 0.1


class Verdict(StrEnum):
    """Verdict of a diagnosis."""

    NOTHING = "nothing"
    NAMED = "named"
    REMAINDER = "named with remainder"
    UNKNOWN = "unknown"
    DISCOVERED = "discovered"
    GROSS_ERROR = "gross error"


@dataclass(frozen=True, slots=True)
class Value:
    """An estimated parameter of an effect.

    Attributes
    ----------
    value : float
    unit : str
    ci95 : tuple of float or None
        95 % confidence interval, given that the extended simulation is right; None if it is unknown.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Finding:
    """A named cause of the discrepancy.

    Attributes
    ----------
    name, family : str
        Name and family in the catalogue.
    confidence : float
        Confidence among the alternative causes, from 0 to 1.
    equivalents : tuple of str
        Names of the causes that the record cannot distinguish from this one.
    parameters : mapping of str to Value
    score : float
        Score gain in minus twice the log-likelihood, less the BIC penalty.
    explained_fraction : float or None
        Fraction of the explainable misfit that the cause explains; None for a property of the noise.
    """

    name: str
    family: str
    confidence: float
    equivalents: tuple[str, ...]
    parameters: Mapping[str, Value]
    score: float
    explained_fraction: float | None


def remove_chance_effects(
    hypothesis: Hypothesis, base: CalibrationResult, target: Target, effects: Sequence[Effect]
) -> Hypothesis:
    """Remove the effects with gains that the record's noise reaches by chance, the least important first.

    Under model error, causes may mask each other: all of them are kept, or none.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects.
    effects : sequence of Effect
        Effects that were searched for.
    """
    if target.effective_samples is not None and len(hypothesis.effects) > 1:
        gain = base.score - hypothesis.fit.score
        selection = ForwardSelection(base, target, effects, len(hypothesis.effects))
        return hypothesis if gain > selection.compute_chance_gain() else Hypothesis(base, base.score, ())
    for effect in hypothesis.effects[::-1]:
        without = without_effect(hypothesis, effect, target)
        gain = without.cost - hypothesis.cost + bic_penalty(effect, hypothesis.fit)
        if gain <= compute_chance_gain(hypothesis.fit, without.fit, effect, target, len(effects)):
            hypothesis = without
    return hypothesis


def validate_out_of_sample(
    hypothesis: Hypothesis, base: CalibrationResult, target: Target, fitted: int, rng: np.random.Generator
) -> Hypothesis:
    """Remove effects, the least important first, until the rest has a cross-validated gain.

    If a confounder is more likely than one of the effects, also remove further effects that may only fit the
    part of its response that no simulation reproduces.
    """
    while hypothesis.effects:
        reference = choose_reference_fit(hypothesis, base, target)
        keep_values = reference is not base
        if cross_validate_gain(reference, keep_values, hypothesis.fit, target, fitted, rng) > 0.0:
            break
        hypothesis = without_effect(hypothesis, hypothesis.effects[-1], target)
    excess = _sum_confounder_excess(hypothesis, target)
    for effect in hypothesis.effects[:0:-1] if excess else ():
        without = without_effect(hypothesis, effect, target)
        decrease = without.fit.mean_square - hypothesis.fit.mean_square
        if decrease < MIN_CONFOUNDED_FRACTION * excess and effect.family != "scale":
            hypothesis = without
    return hypothesis


def _sum_confounder_excess(hypothesis: Hypothesis, target: Target) -> float:
    """Return the mean square of the parts of likely confounders' responses that no simulation reproduces."""
    confounders = (find_confounder(hypothesis.fit, effect, target) for effect in hypothesis.effects)
    return sum(
        confounder.excess_mean_square
        for confounder in confounders
        if confounder is not None and confounder.score_gain > MIN_GAIN
    )


def choose_reference_fit(
    hypothesis: Hypothesis, base: CalibrationResult, target: Target
) -> CalibrationResult:
    """Return the fit that a hypothesis is compared with: the calibrated simulation without effects.

    Calibration absorbs a wrong gain or parameter. A hypothesis that has only such effects is therefore
    compared with the simulation at its nominal values. Initial states of recordings after the first have no
    nominal values and are those of the calibration.
    """
    if all(effect.family == "scale" for effect in hypothesis.effects):
        simulation = base.simulation
        nominal = np.where(simulation.is_copy, base.values, simulation.nominal)
        return evaluate_fit(simulation, target, nominal)
    return base


def explained_fraction(before: CalibrationResult, after: CalibrationResult, floor: float) -> float:
    """Return the explained fraction of the misfit above ``floor``, the mean square of the noise."""
    misfit = before.mean_square - floor
    if misfit <= 0.0:
        return 0.0
    return float(np.clip((before.mean_square - after.mean_square) / misfit, 0.0, 1.0))


def classify(explained: float, has_effects: bool, has_remainder: bool, is_model_error: bool) -> Verdict:
    """Return the verdict on effects that explain a fraction of the misfit.

    Under model error a remainder is expected, so that `MIN_EXPLAINED_FRACTION` is enough.
    """
    if not has_effects:
        return Verdict.UNKNOWN if has_remainder or is_model_error else Verdict.NOTHING
    required = (
        MIN_EXPLAINED_FRACTION_WITH_REMAINDER
        if has_remainder and not is_model_error
        else MIN_EXPLAINED_FRACTION
    )
    if explained < required:
        return Verdict.UNKNOWN
    return Verdict.REMAINDER if has_remainder else Verdict.NAMED


def describe_effects(
    hypothesis: Hypothesis,
    base: CalibrationResult,
    screened: Sequence[ScreenedEffect],
    target: Target,
    effects: Sequence[Effect],
    floor: float,
    parallel_map: ParallelMap = map,
) -> tuple[tuple[Finding, ...], tuple[ScreenedEffect, ...]]:
    """Return the findings of a hypothesis, and the alternatives that the record cannot distinguish from them.

    The alternatives of each effect are those that were screened without it.

    Parameters
    ----------
    base, screened : CalibrationResult, sequence of ScreenedEffect
        The simulation without effects and the effects screened on it; they are the alternatives if the
        hypothesis has a single effect.
    floor : float
        Mean square of the noise.
    """
    findings, equivalents = [], []
    deviations = np.sqrt(np.maximum(np.diag(estimate_covariance(hypothesis.fit, target)), 0.0))
    if len(hypothesis.effects) == 1:
        alternatives: Sequence[Alternatives] = (Alternatives(Hypothesis(base, base.score, ()), screened),)
    else:
        alternatives = hypothesis.alternatives or find_alternatives(hypothesis, target, effects, parallel_map)
    for effect, alternative in zip(hypothesis.effects, alternatives, strict=True):
        without = alternative.without
        scores = {each.effect.cause: each.score_gain(without.fit) for each in reversed(alternative.screened)}
        score = max(scores.get(effect.cause, 0.0), without.cost - hypothesis.cost)
        scores[effect.cause] = score
        name, family, values = effect.cause, effect.family, _get_values(hypothesis.fit, effect, deviations)
        if (confounder := find_confounder(hypothesis.fit, effect, target)) is not None:
            scores[confounder.effect.cause] = score + confounder.score_gain
            if confounder.score_gain > 0.0:
                name, family = confounder.effect.cause, confounder.effect.family
                values = _scale_values(confounder, values, hypothesis.fit)
        equal = {each for each, score in scores.items() if score > scores[name] - EQUIVALENCE_MARGIN} - {name}
        equivalents += [each for each in alternative.screened if each.effect.cause in equal]
        reference = choose_reference_fit(hypothesis, without.fit, target)
        findings.append(
            Finding(
                name,
                family,
                _compute_confidence(scores[name], scores),
                tuple(sorted(equal, key=lambda name: -scores[name])),
                values,
                scores[name],
                explained_fraction(reference, hypothesis.fit, floor),
            )
        )
    return tuple(findings), tuple(equivalents)


def _compute_confidence(score: float, scores: Mapping[str, float]) -> float:
    alternatives = (*scores.values(), 0.0)  # 0: no effect at all
    return 1.0 / sum(
        float(np.exp(min(other - score, 0.0) / (2 * CONFIDENCE_TEMPERATURE))) for other in alternatives
    )


def _scale_values(
    confounder: Confounder, values: Mapping[str, Value], fit: CalibrationResult
) -> Mapping[str, Value]:
    """Return the values of a confounder, given those of the effect that it replaces."""
    parameters = confounder.effect.parameters(fit.simulation.context)
    scaled = {}
    for parameter, each in zip(parameters, values.values(), strict=True):
        low, high = each.ci95 or (each.value, each.value)
        ci95 = None if each.ci95 is None else (confounder.factor * low, confounder.factor * high)
        scaled[parameter.name] = Value(confounder.factor * each.value, parameter.unit, ci95)
    return scaled


def _get_values(fit: CalibrationResult, effect: Effect, deviations: Signal) -> Mapping[str, Value]:
    """Return the values of an effect with their confidence intervals, given all standard deviations.

    Initial states of recordings after the first are left out.
    """
    part = fit.simulation.get_slice(effect)
    values = {}
    for index in range(part.start, part.stop):
        if fit.simulation.is_copy[index]:
            continue
        parameter, value = fit.simulation.parameters[index], float(fit.values[index])
        half_width = 1.96 * float(deviations[index])
        values[parameter.name] = Value(value, parameter.unit, (value - half_width, value + half_width))
    return values
