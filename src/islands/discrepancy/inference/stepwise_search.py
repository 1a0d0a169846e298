"""The search for causes: single effects and combinations, a few of them followed at a time."""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target
from islands.discrepancy.effects import model_form
from islands.discrepancy.inference.hypothesis import (
    Alternatives,
    Hypothesis,
    find_alternatives,
    refit,
    with_effect,
    without_effect,
)
from islands.discrepancy.inference.screening import EQUAL, ScreenedEffect, screen_effects
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.evolution.progress import ProgressCallback

#: The least that an effect has to gain, in minus twice the log-likelihood: six is one to twenty.
LEAST = 6.0

#: Combinations that are followed at a time, effects in one, and effects that pairs begin with.
BEAM, MOST, SEEDS = 3, 3, 6

#: Fits with the memory of the noise that the one before has left, at the most.
REFITS = 6


def stepwise_search(
    base: CalibrationResult,
    first: Sequence[ScreenedEffect],
    target: Target,
    effects: Sequence[Effect],
    progress: ProgressCallback,
    spread: ParallelMap = map,
    pairs: bool = False,
) -> tuple[Hypothesis, Target]:
    """Return the best explanation, and what it was held against.

    From the simulation alone, effect after effect, as long as that pays. What the noise remembers is
    estimated anew with each: before, the causes that were not yet found were a part of it.

    Parameters
    ----------
    base : CalibrationResult
        The simulation alone.
    first : sequence of ScreenedEffect
        Its ladder.
    pairs : bool
        The first of two need not pay alone: two causes may hide each other.
    """
    best = Hypothesis(base, base.score, ())
    followed = [best]
    most = MOST + 1 if pairs else MOST
    while followed and _causes(followed[0]) < most:
        alone = not followed[0].effects
        if not alone:
            progress(f"effects beside {' and '.join(effect.name for effect in followed[0].effects)}")
        least = LEAST if alone else _further(target, effects)
        further: dict[frozenset[str], Hypothesis] = {}
        for each in followed:
            others = [effect for effect in effects if effect not in each.effects]
            rungs = first if alone else screen_effects(each.fit, target, others, spread)
            for rung in rungs[: SEEDS if alone and pairs else BEAM]:
                found = with_effect(each, rung)
                key = frozenset(effect.name for effect in found.effects)
                pays = (alone and pairs) or found.cost < each.cost - least
                if pays and (key not in further or found.cost < further[key].cost):
                    further[key] = found
        followed = sorted(further.values(), key=attrgetter("rank"))[: SEEDS if alone and pairs else BEAM]
        followed, there = _remembered(followed, target)
        if followed and followed[0].cost < best.cost - least:
            best, target = followed[0], there
        elif not (alone and pairs):
            break
    return refine_by_swaps(best, target, effects, progress, spread, most)


def _causes(found: Hypothesis) -> int:
    """Count causes: that the form of an identified model is wrong stands beside them."""
    return sum(effect.cause != model_form.CORE_SHAPE for effect in found.effects)


def _remembered(followed: list[Hypothesis], target: Target) -> tuple[list[Hypothesis], Target]:
    """Fit explanations anew, whitened by what the best of them has left."""
    for _ in range(REFITS if followed and target.effective_samples is None else 0):
        before = followed[0].cost
        target = replace(target, noise=followed[0].fit.noise)
        followed = sorted((refit(each, target) for each in followed), key=attrgetter("rank"))
        if followed[0].cost > before - EQUAL:
            break
    return followed, target


def refine_by_swaps(
    found: Hypothesis,
    target: Target,
    effects: Sequence[Effect],
    progress: ProgressCallback,
    spread: ParallelMap = map,
    most: int = MOST,
) -> tuple[Hypothesis, Target]:
    """Leave out what is not needed, put what explains more in an effect's place, and add what pays beside it.

    What came first may mislead, and be left out again: then there may be more to find. Scores fall with
    every step, so that there is a last one.

    Parameters
    ----------
    found : Hypothesis
        Beside all its effects together nothing pays, or they are as many as may be.
    """
    complete = found.effects
    least = _further(target, effects)
    found = _thinned(found, target, least)
    while found.effects:
        rivals: tuple[Alternatives, ...] = ()
        further = []
        if len(found.effects) > 1:
            progress("what else could be the cause")
            rivals = find_alternatives(found, target, effects, spread)
            further = [with_effect(each.without, rung) for each in rivals for rung in each.screened[:1]]
        if len(found.effects) < len(complete) and _causes(found) < most:
            others = [effect for effect in effects if effect not in found.effects]
            beside = [
                with_effect(found, rung) for rung in screen_effects(found.fit, target, others, spread)[:1]
            ]
            further += [each for each in beside if each.cost < found.cost - least]
        best = min(further, key=attrgetter("rank"), default=found)
        if best.cost > found.cost - EQUAL:
            return replace(found, alternatives=rivals), target
        if set(best.effects) == set(found.effects) and best.cost > found.cost - LEAST:
            # The same with slightly better values: no other names would come of going round again.
            return replace(found, fit=best.fit, cost=best.cost, alternatives=rivals), target
        complete = best.effects
        (found,), target = _remembered([_thinned(best, target, least)], target)
    return found, target


def _further(target: Target, effects: Sequence[Effect]) -> float:
    """Return what an effect has to gain beside another: any of them could be the one that does so by chance.

    Where the form is wrong it is no chance, and pairs are found by less.
    """
    return LEAST if target.effective_samples is not None else LEAST + 2.0 * float(np.log(len(effects)))


def _thinned(found: Hypothesis, target: Target, least: float) -> Hypothesis:
    """Leave out what is not needed any more beside what came later, and put the most important first.

    The last one as well: its own values and the noise's memory, found with it, may do without.
    """
    while found.effects:
        without = {effect.name: without_effect(found, effect, target) for effect in found.effects}
        cheapest = min(without.values(), key=attrgetter("rank"))
        if cheapest.cost - found.cost >= (least if len(found.effects) > 1 else LEAST):
            ranked = sorted(found.effects, key=lambda effect: -without[effect.name].cost)
            return Hypothesis(found.fit, found.cost, tuple(ranked))
        found = cheapest
    return found
