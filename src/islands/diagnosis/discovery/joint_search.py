"""Search for missing terms together with effects.

Terms that are fitted without an effect that acts as well are approximations of both, and so are effects that
are fitted without a term. Terms are therefore searched for with effects in the simulation.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, whiten_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.term_search import TermSearchResult, search_terms
from islands.diagnosis.inference.hypothesis import Hypothesis, with_effect
from islands.diagnosis.inference.screening import (
    screen_effects,
    transfer_effects,
    transfer_parameters,
)
from islands.diagnosis.inference.stepwise_search import MIN_GAIN, eliminate_backward, refit_with_ar_noise
from islands.diagnosis.inference.strategies import SearchOutcome, assess_evidence, make_outcome
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CORE_SHAPE, catalogue_order
from islands.effects.interface.effect import Effect


class JointResult(NamedTuple):
    """Missing terms, and the effects that act in addition to them.

    Attributes
    ----------
    terms : TermSearchResult
    outcome : SearchOutcome or None
        The effects. The base of the outcome is the simulation with the terms. None if there are no effects.
    """

    terms: TermSearchResult
    outcome: SearchOutcome | None = None


def search_jointly(
    found: TermSearchResult | None,
    base: CalibrationResult,
    alone: SearchOutcome,
    least: float,
    target: Target,
    run: DiagnosisRun,
) -> JointResult | None:
    """Search for terms with effects in the simulation; return None if none are found, or no effect remains.

    The effects are those of a hypothesis without one of them, a single one that leaves a remainder, and the
    best one in addition to terms that explain more than a hypothesis.

    Parameters
    ----------
    found : TermSearchResult or None
        Terms that were found without effects.
    least : float
        Cost of the effects without terms.
    base, alone, target, run
        Arguments of `discovery.find_missing_terms`.
    """
    starts = _list_starts(alone)
    if found is not None and (found.cost < least or len(alone.hypothesis.effects) < 2):
        starts += _add_effect(found, target, run)
    best: TermSearchResult | None = None
    for kept in {frozenset(each.effects): each for each in starts}.values():
        if not any(each.is_free or each.family == "scale" for each in kept.effects):
            terms = _search_one_term(kept, base, target, run)
            if terms is not None and (best is None or terms.cost < best.cost):
                best = terms
    if best is None:
        return None
    terms = search_terms(best.base, target, run, least, best)
    return assess_effects(terms or best, target, run)


def _list_starts(alone: SearchOutcome) -> list[Hypothesis]:
    """Return a hypothesis without each of its effects, not refitted, or a single one with a remainder.

    An identified model also has its model-form error alone, which all effects may imitate.
    """
    found, base = alone.hypothesis, alone.base
    if len(found.effects) == 1:
        return [found] if alone.verdict == Verdict.REMAINDER else []
    starts = [
        replace(found, effects=tuple(each for each in found.effects if each is not effect))
        for effect in found.effects
    ]
    forms = [each for each in alone.screened if each.effect.name == CORE_SHAPE]
    return starts + [with_effect(Hypothesis(base, base.score, ()), each) for each in forms]


def _add_effect(found: TermSearchResult, target: Target, run: DiagnosisRun) -> list[Hypothesis]:
    """Return the hypothesis of the effect that improves the equations with terms most, if one does."""
    fit = found.fit
    screened = screen_effects(fit, whiten_target(target, fit), run)
    alone = Hypothesis(fit, found.cost, ())
    return [with_effect(alone, each) for each in screened[:1] if each.score_gain(fit) > MIN_GAIN]


def _search_one_term(
    kept: Hypothesis, base: CalibrationResult, target: Target, run: DiagnosisRun
) -> TermSearchResult | None:
    """Search for a term with the effects of a hypothesis in the simulation of ``base``."""
    whitened = whiten_target(target, kept.fit)
    start = calibrate_with_effects(base, kept.effects, kept.fit, whitened)
    terms = search_terms(start, target, run, max_terms=1)
    if terms is None:
        return None
    # Without the term, the fit may have moved an instant or a frequency to another optimum.
    values = terms.fit.values.copy()
    transfer_effects(kept.fit.values, kept.fit.simulation, values, terms.fit.simulation)
    again = calibrate(terms.fit.simulation, whitened, values)
    return replace(terms, fit=again) if again.score < terms.fit.score else terms


def calibrate_with_effects(
    base: CalibrationResult, effects: Sequence[Effect], known: CalibrationResult, target: Target
) -> CalibrationResult:
    """Calibrate a simulation with effects, from its values and those of the effects in another fit."""
    effects = catalogue_order(effects, known.simulation.effects)
    simulation = replace(base.simulation, effects=effects)
    start = transfer_parameters(base.values, base.simulation, simulation)
    transfer_effects(known.values, known.simulation, start, simulation)
    return calibrate(simulation, target, start)


def assess_effects(terms: TermSearchResult, target: Target, run: DiagnosisRun) -> JointResult | None:
    """Return the terms with those of their effects that pass the tests of effects; None if no effect does."""
    fit, whitened = terms.fit, whiten_target(target, terms.fit)
    without = _calibrate_with(fit, (), whitened)
    (hypothesis,), whitened = refit_with_ar_noise([Hypothesis(fit, terms.cost, terms.effects)], whitened)
    hypothesis = eliminate_backward(hypothesis, whitened, MIN_GAIN, run)
    outcome = assess_evidence(make_outcome(without, (), whitened, hypothesis), run)
    kept = outcome.hypothesis
    if not kept.effects:
        return None
    base = terms.base
    if set(kept.effects) != set(terms.effects):
        base = _calibrate_with(base, kept.effects, whitened)
    return JointResult(replace(terms, base=base, fit=kept.fit), outcome)


def _calibrate_with(fit: CalibrationResult, effects: Sequence[Effect], target: Target) -> CalibrationResult:
    """Calibrate the simulation of a fit with some of its effects."""
    simulation = fit.simulation.with_effects(effects)
    return calibrate(simulation, target, transfer_parameters(fit.values, fit.simulation, simulation))
