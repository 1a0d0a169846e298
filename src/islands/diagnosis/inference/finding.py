"""Findings: named causes with their confidence, their parameters, and the causes that explain as much."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    estimate_deviations,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.confidence import (
    ScoredAlternative,
    compute_confidence,
    make_unlisted_cause,
    sum_squares_by_block,
)
from islands.diagnosis.inference.confounders import Confounder, find_confounder
from islands.diagnosis.inference.hypothesis import Alternatives, Hypothesis, find_alternatives
from islands.diagnosis.inference.jump_intervals import find_jump_intervals
from islands.diagnosis.inference.resemblance import Resemblance, describe_curve_signal, find_resemblance
from islands.diagnosis.inference.screening import ScreenedEffect, bic_penalty
from islands.diagnosis.inference.strategies import SearchOutcome
from islands.diagnosis.inference.verdict import (
    Verdict,
    choose_reference_fit,
    explained_fraction,
    noise_fraction,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect

#: Effects whose scores are within this margin of the named one cannot be distinguished from it.
EQUIVALENCE_MARGIN = 9.0

#: Probability with which the further coefficients of a free form gain less by chance.
CHANCE_QUANTILE = 0.99


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

    @classmethod
    def estimate(cls, value: float, unit: str, deviation: float) -> Self:
        """Return an estimate with a standard deviation."""
        half_width = 1.96 * deviation
        return cls(value, unit, (value - half_width, value + half_width))


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
    error_fraction : float or None
        Fraction of the mean squared error that the cause explains; None for a property of the
        noise.
    noise_fraction : float or None
        Fraction of that error that is noise: the noise floor, which may be an upper bound.
    term : str
        Missing term with its equation, as ``a1*(x*v) in dv/dt``; empty for an effect.
    summary : str
        What a missing term means, without a period; empty if it is no known law, and for an effect.
    depends_on_time : bool
        Whether it is a function of the time of the record.
    is_claimed : bool
        Whether it is claimed as a cause. If a remainder shows that the simulation is still wrong, only the
        first effect is: further ones may follow its wrong form. No cause is if others are much more probable.
    resembles : Resemblance or None
        Simple law that a free curve has within its intervals; None for another effect.
    place : str
        State or parameter that it acts on; empty if it is another kind of effect.
    """

    name: str
    family: str
    confidence: float
    equivalents: tuple[str, ...]
    parameters: Mapping[str, Value]
    score: float
    explained_fraction: float | None
    is_claimed: bool = True
    error_fraction: float | None = None
    noise_fraction: float | None = None
    term: str = ""
    summary: str = ""
    depends_on_time: bool = False
    resembles: Resemblance | None = None
    place: str = ""


def list_free_forms(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings that are free forms."""
    return [each for each in findings if each.name in CATALOGUE and CATALOGUE[each.name].is_free]


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """Another explanation of a record than its effects.

    Attributes
    ----------
    name : str
    fit : CalibrationResult
    lead : float
        By how much its score exceeds that of the effects.
    size : int
        Number of its causes.
    effects : tuple of Effect
        Effects that it has in addition to these causes.
    """

    name: str
    fit: CalibrationResult
    lead: float
    size: int
    effects: tuple[Effect, ...] = ()

    def is_alternative(self, effect: Effect, effects: Sequence[Effect]) -> bool:
        """Return whether it explains a record without one of several effects.

        With as many causes as there are effects, it is another form of all of them together.
        """
        if self.effects or len(effects) == 1:
            return effect not in self.effects
        return self.size < len(effects)


def describe_effects(
    outcome: SearchOutcome, run: DiagnosisRun, rival: Rival | None = None
) -> tuple[tuple[Finding, ...], tuple[ScreenedEffect, ...]]:
    """Return the findings of a search, and the alternatives that the record cannot distinguish from them.

    The alternatives of a single effect are all that were screened; those of each of several ones are screened
    without it.

    Parameters
    ----------
    outcome : SearchOutcome
    run : DiagnosisRun
    rival : Rival, optional
        Further alternative of those effects that it does not have.
    """
    hypothesis = outcome.hypothesis
    deviations = estimate_deviations(hypothesis.fit, outcome.target)
    findings, equivalents = [], list[ScreenedEffect]()
    for effect, alternatives in zip(hypothesis.effects, _list_alternatives(outcome, run), strict=True):
        finding, equal = _describe_effect(effect, alternatives, outcome, rival, deviations)
        findings.append(finding)
        equivalents += equal
    return tuple(findings), tuple(equivalents)


def _list_alternatives(outcome: SearchOutcome, run: DiagnosisRun) -> Sequence[Alternatives]:
    """Return the alternatives to each effect of an outcome."""
    base, hypothesis = outcome.base, outcome.hypothesis
    if len(hypothesis.effects) == 1:
        return (Alternatives(Hypothesis(base, base.score, ()), outcome.screened),)
    return hypothesis.alternatives or find_alternatives(hypothesis, outcome.target, run)


def _describe_effect(
    effect: Effect,
    alternatives: Alternatives,
    outcome: SearchOutcome,
    rival: Rival | None,
    deviations: Signal,
) -> tuple[Finding, list[ScreenedEffect]]:
    """Return the finding of one effect of an outcome, and its equivalents."""
    hypothesis, target, without = outcome.hypothesis, outcome.target, alternatives.without
    fit = hypothesis.fit
    screened = _list_screened(effect, alternatives, outcome)
    scored = _score_causes(effect, without.cost - hypothesis.cost, screened, outcome, rival)
    named_effect, values = effect, _get_values(fit, effect, deviations, target)
    if (confounder := find_confounder(fit, effect, target)) is not None:
        score = scored[effect.cause].score + confounder.score_gain
        scored[confounder.effect.cause] = ScoredAlternative(score, None)
        if confounder.score_gain > 0.0:
            named_effect, values = confounder.effect, _scale_values(confounder, values, fit)
    name = named_effect.cause
    named = scored.pop(name)
    others = [*scored.values(), ScoredAlternative(0.0, sum_squares_by_block(without.fit, fit, target))]
    reference = choose_reference_fit(hypothesis.effects, without.fit, target)
    explained = explained_fraction(reference, fit, outcome.noise_floor)
    if outcome.verdict == Verdict.REMAINDER and explained < 1.0:
        others.append(make_unlisted_cause(named, 1.0 - explained))
    free = {each.effect.cause for each, _ in screened if each.effect.is_free}
    equal = list_equivalents(scored, named, free)
    opposed = outcome.cancelled.get(effect.name, ())
    equal += tuple(each for each in opposed if each not in (name, *equal))
    finding = Finding(
        name,
        named_effect.family,
        compute_confidence(named, others),
        equal,
        values,
        named.score,
        explained,
        error_fraction=explained_fraction(reference, fit, 0.0),
        noise_fraction=noise_fraction(reference, outcome.noise_floor),
        depends_on_time=effect.depends_on_time,
        resembles=_find_resemblance(effect, values, fit),
        place=named_effect.place,
    )
    return finding, [each for each, _ in screened if each.effect.cause in equal]


def _find_resemblance(
    effect: Effect, values: Mapping[str, Value], fit: CalibrationResult
) -> Resemblance | None:
    """Return the law that a free curve resembles; None for another effect."""
    signal = describe_curve_signal(effect.name, fit.simulation.context)
    if signal is None:
        return None
    bounds = np.array([each.ci95 or (each.value, each.value) for each in values.values()])
    return find_resemblance(bounds.mean(axis=1), 0.5 * np.diff(bounds)[:, 0], signal)


def list_equivalents(
    scored: Mapping[str, ScoredAlternative], named: ScoredAlternative, free: Collection[str]
) -> tuple[str, ...]:
    """Return the causes that a record cannot distinguish from the named one, best first, equal ones by name.

    Parameters
    ----------
    scored : mapping
        The other causes with their scores.
    named : ScoredAlternative
    free : collection of str
        Causes of free forms, which have to be better than the named one.
    """
    equal = [
        cause
        for cause, other in scored.items()
        if other.score > named.score - (0.0 if cause in free else EQUIVALENCE_MARGIN)
    ]
    return tuple(sorted(equal, key=lambda cause: (-scored[cause].score, cause)))


def _list_screened(
    effect: Effect, alternatives: Alternatives, outcome: SearchOutcome
) -> list[tuple[ScreenedEffect, CalibrationResult]]:
    """Return the effects and forms that could take the place of an effect, and the fits without them.

    A form of which the effect is a special case is none of them. Of an effect with several behaviours of the
    input, the best one is taken.
    """
    further = [each.get(effect.name) for each in (outcome.form_alternatives, outcome.timing_alternatives)]
    effects = {*outcome.hypothesis.effects}
    compared = [alternatives]
    compared += [each for each in further if each and {*each.without.effects, effect} == effects]
    found: dict[str, tuple[ScreenedEffect, CalibrationResult]] = {}
    for each in compared:
        for screened in each.screened:
            known = found.get(screened.effect.name)
            is_better = known is None or screened.score_gain(each.without.fit) > known[0].score_gain(known[1])
            if is_better and effect.cause not in screened.effect.special_cases:
                found[screened.effect.name] = screened, each.without.fit
    return list(found.values())


def _score_causes(
    effect: Effect,
    gain: float,
    screened: Sequence[tuple[ScreenedEffect, CalibrationResult]],
    outcome: SearchOutcome,
    rival: Rival | None,
) -> dict[str, ScoredAlternative]:
    """Return the scores of an effect and of its alternatives by cause.

    Parameters
    ----------
    gain : float
        Score gain of the effect in its hypothesis.
    """
    hypothesis, target = outcome.hypothesis, outcome.target
    scored = {
        each.effect.cause: ScoredAlternative(
            _compute_score(each, effect, without), sum_squares_by_block(each.fit, hypothesis.fit, target)
        )
        for each, without in reversed(screened)
    }
    score = max(scored[effect.cause].score if effect.cause in scored else 0.0, gain)
    squares = sum_squares_by_block(hypothesis.fit, hypothesis.fit, target)
    scored[effect.cause] = ScoredAlternative(score, squares)
    if rival is not None and rival.is_alternative(effect, hypothesis.effects):
        squares = sum_squares_by_block(rival.fit, hypothesis.fit, target)
        scored[rival.name] = ScoredAlternative(score + rival.lead, squares)
    return scored


def compute_form_chance(form: Effect, effects: Sequence[Effect], fit: CalibrationResult) -> float:
    """Return what a free form gains by chance over effects that are right, in minus twice the log-likelihood.

    It is the 0.99 quantile of the chi-square distribution with the number of its further coefficients.
    """
    context = fit.simulation.context
    count = sum(len(effect.parameters(context)) for effect in effects)
    further = max(len(form.parameters(context)) - count, 1)
    return 2.0 * float(scipy.special.gammaincinv(further / 2.0, CHANCE_QUANTILE))


def _compute_score(screened: ScreenedEffect, named: Effect, without: CalibrationResult) -> float:
    """Return the score gain of an alternative.

    Further coefficients of a free form have the penalty of chance instead of that of the BIC, with which
    seven coefficients are never better than a wrong effect with one.
    """
    gain = screened.score_gain(without)
    if not screened.effect.is_free or named.is_free:
        return gain
    penalties = bic_penalty(screened.effect, without) - bic_penalty(named, without)
    return gain + penalties - compute_form_chance(screened.effect, (named,), without)


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


def _get_values(
    fit: CalibrationResult, effect: Effect, deviations: Signal, target: Target
) -> Mapping[str, Value]:
    """Return the values of an effect with their confidence intervals, given all standard deviations.

    Initial states of recordings after the first are left out. Values that jump have no derivative, and
    intervals of the likelihood.
    """
    part = fit.simulation.get_slice(effect)
    intervals = find_jump_intervals(fit, effect, target) if effect.centre is not None else None
    values = {}
    for place, index in enumerate(range(part.start, part.stop)):
        if fit.simulation.is_copy[index]:
            continue
        parameter, value = fit.simulation.parameters[index], float(fit.values[index])
        values[parameter.name] = (
            Value.estimate(value, parameter.unit, float(deviations[index]))
            if effect.centre is None
            else Value(value, parameter.unit, intervals[place] if intervals else None)
        )
    return values
