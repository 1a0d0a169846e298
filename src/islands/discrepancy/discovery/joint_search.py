"""Search for missing terms together with effects.

Terms that are fitted without an effect that acts as well are approximations of both, and so are effects that
are fitted without a term. Terms are therefore searched for with effects in the simulation.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, calibrate, whiten_target
from islands.discrepancy.calibration.target import Target
from islands.discrepancy.discovery.term_search import TermSearchResult, search_terms
from islands.discrepancy.effects import catalogue_order
from islands.discrepancy.inference.hypothesis import Hypothesis
from islands.discrepancy.inference.screening import screen_effects, transfer_parameters
from islands.discrepancy.inference.stepwise_search import (
    MIN_GAIN,
    eliminate_backward,
    refit_with_ar_noise,
    stepwise_search,
)
from islands.discrepancy.inference.strategies import (
    SearchOutcome,
    assess_evidence,
    make_outcome,
)
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.effect import Effect, Signal
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.evolution.progress import ignore_progress


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
    target: Target,
    effects: Sequence[Effect],
    fitted: int,
    rng: np.random.Generator,
    parallel_map: ParallelMap = map,
) -> JointResult | None:
    """Search for terms with effects in the simulation, and return the best terms, with or without effects.

    The effects are those that improve the equations with the given terms, those of a hypothesis without one
    of them, and a single one that leaves a remainder.

    Parameters
    ----------
    found : TermSearchResult or None
        Terms that were found without effects.
    base : CalibrationResult
        The simulation without effects, calibrated to unweighted residuals.
    alone : SearchOutcome
        Outcome of the search for effects without terms.
    target : Target
        Target of ``base``.
    effects : sequence of Effect
        Effects that are searched for.
    fitted : int
        Number of samples used for estimation.
    """
    starts = _list_starts(alone)
    if found is not None:
        starts += _add_effects(found, target, effects, parallel_map)
    results = [] if found is None else [JointResult(found)]
    for kept in {frozenset(each.effects): each for each in starts}.values():
        if kept.effects and not any(each.is_free or each.family == "scale" for each in kept.effects):
            terms = _search_with(kept, base, target, parallel_map)
            if terms is not None:
                results += _assess_effects(terms, target, effects, fitted, rng, parallel_map)
    return min(results, key=lambda each: each.terms.cost, default=None)


def _list_starts(alone: SearchOutcome) -> list[Hypothesis]:
    """Return a hypothesis without each of its effects, not refitted, or a single one with a remainder."""
    found = alone.hypothesis
    if len(found.effects) == 1:
        return [found] if alone.verdict == Verdict.REMAINDER else []
    return [
        replace(found, effects=tuple(each for each in found.effects if each is not effect))
        for effect in found.effects
    ]


def _add_effects(
    found: TermSearchResult, target: Target, effects: Sequence[Effect], parallel_map: ParallelMap
) -> list[Hypothesis]:
    """Return the best hypothesis on the equations with terms.

    The terms are searched for again with its effects, so that those that gain nothing alone are left out.
    """
    fit, whitened = found.fit, whiten_target(target, found.fit)
    screened = screen_effects(fit, whitened, effects, parallel_map)
    gaining = [each.effect for each in screened if each.score_gain(fit) > 0.0]
    return [stepwise_search(fit, screened, whitened, gaining, ignore_progress, parallel_map)[0]]


def _search_with(
    kept: Hypothesis, base: CalibrationResult, target: Target, parallel_map: ParallelMap
) -> TermSearchResult | None:
    """Search for terms with the effects of a hypothesis in the simulation of ``base``."""
    simulation = base.simulation.with_effects(catalogue_order(kept.effects))
    whitened = whiten_target(target, kept.fit)
    start = _copy_effects(kept, simulation, transfer_parameters(base.values, base.simulation, simulation))
    terms = search_terms(calibrate(simulation, whitened, start), target, parallel_map)
    if terms is None:
        return None
    # As long as terms were missing, the fit may have moved an instant or a frequency to another optimum.
    values = _copy_effects(kept, terms.fit.simulation, terms.fit.values)
    again = calibrate(terms.fit.simulation, whitened, values)
    return replace(terms, fit=again) if again.score < terms.fit.score else terms


def _copy_effects(source: Hypothesis, simulation: ExtendedSimulator, values: Signal) -> Signal:
    """Return values of a simulation, those of its effects from a hypothesis."""
    copied = values.copy()
    for effect in simulation.effects:
        copied[simulation.get_slice(effect)] = source.fit.values[source.fit.simulation.get_slice(effect)]
    return copied


def _assess_effects(
    terms: TermSearchResult,
    target: Target,
    effects: Sequence[Effect],
    fitted: int,
    rng: np.random.Generator,
    parallel_map: ParallelMap,
) -> list[JointResult]:
    """Return the terms with those of their effects that pass the tests of effects; none if no effect does."""
    fit, whitened = terms.fit, whiten_target(target, terms.fit)
    simulation = fit.simulation.with_effects(())
    without = calibrate(simulation, whitened, transfer_parameters(fit.values, fit.simulation, simulation))
    (hypothesis,), whitened = refit_with_ar_noise([Hypothesis(fit, terms.cost, terms.effects)], whitened)
    hypothesis = eliminate_backward(hypothesis, whitened, MIN_GAIN, parallel_map)
    outcome = assess_evidence(make_outcome(without, (), whitened, hypothesis), fitted, effects, rng)
    kept = outcome.hypothesis
    if not kept.effects:
        return []
    base = terms.base
    if set(kept.effects) != set(terms.effects):
        simulation = base.simulation.with_effects(catalogue_order(kept.effects))
        start = transfer_parameters(base.values, base.simulation, simulation)
        base = calibrate(simulation, whitened, start)
    return [JointResult(replace(terms, base=base, fit=kept.fit), outcome)]
