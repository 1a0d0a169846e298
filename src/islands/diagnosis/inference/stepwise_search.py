"""Stepwise regression over effects: beam search, refinement by swaps and backward elimination."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, whiten_target
from islands.diagnosis.calibration.starts_calibrator import StartsCalibrator, calibrate_all
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.effect_pairs import add_pair, rank_pairs
from islands.diagnosis.inference.hypothesis import (
    Alternatives,
    Hypothesis,
    find_alternatives,
    remove_each,
    screen_others,
    with_effect,
)
from islands.diagnosis.inference.screening import SCORE_TIE, ScreenedEffect, count_degrees
from islands.diagnosis.run import DiagnosisRun
from islands.effects import catalogue
from islands.effects.interface.effect import Effect
from islands.parallel import ParallelMap

#: Minimum score gain of an effect, in minus twice the log-likelihood: six is a likelihood ratio of twenty.
MIN_GAIN = 6.0

#: Number of hypotheses that are followed at the same time.
BEAM_WIDTH = 3

#: Fraction of the best gain below which a hypothesis is not followed, unless pairs are searched for.
MIN_FOLLOWED_GAIN = 0.1

#: Maximum number of effects of a hypothesis, not counting the model-form error; one more if pairs are
#: searched for.
MAX_EFFECTS = 3

#: Number of single effects from which pairs are built.
PAIR_SEEDS = 6

#: Least gain of a pair by its linear responses that is calibrated, relative to the least gain that it needs.
#: Calibration moves the times and limits of its effects as well, and gained up to six times as much.
MIN_LINEAR_GAIN = 0.5

#: Number of pairs that are tried in place of two effects, and of those with the same effect.
REPLACED_PAIRS, PAIRS_OF_EFFECT = 12, 4

#: Maximum number of refits with the noise model of the previous fit.
MAX_REFITS = 6


def stepwise_search(
    base: CalibrationResult,
    screened: Sequence[ScreenedEffect],
    target: Target,
    run: DiagnosisRun,
    pairs: bool = False,
    start: Hypothesis | None = None,
) -> tuple[Hypothesis, Target]:
    """Return the best hypothesis, and the target with its noise model.

    The search adds one effect after another to the simulation, as long as the cost decreases by enough. It
    estimates the noise model again after each step, since effects that were not found before were part of the
    noise.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects.
    screened : sequence of ScreenedEffect
        Effects screened on ``base``, the best first.
    pairs : bool
        Whether the first effect of a pair may have an insufficient gain alone: two causes may mask each
        other.
    start : Hypothesis, optional
        Hypothesis to which effects are added; the simulation without effects by default.
    """
    best = start or Hypothesis(base, base.score, ())
    beam = [best]
    max_effects = MAX_EFFECTS + 1 if pairs else MAX_EFFECTS
    while beam and _count_causes(beam[0]) < max_effects:
        is_first = not beam[0].effects
        if not is_first:
            names = [effect.name for effect in beam[0].effects]
            run.progress(f"effects in addition to {' and '.join(names)}")
        min_gain = MIN_GAIN if is_first else _get_min_further_gain(target, run.effects)
        is_open = is_first and pairs
        width = PAIR_SEEDS if is_open else BEAM_WIDTH
        candidates = [
            (hypothesis, (screened if is_first else screen_others(hypothesis, target, run))[:width])
            for hypothesis in beam
        ]
        beam = _extend_beam(candidates, None if is_open else min_gain)[:width]
        beam, new_target = refit_with_ar_noise(beam, target, run.parallel_map)
        if beam and beam[0].cost < best.cost - min_gain:
            best, target = beam[0], new_target
        elif not is_open:
            break
        if not pairs:
            least = MIN_FOLLOWED_GAIN * (base.score - beam[0].cost)
            beam = [each for each in beam if base.score - each.cost >= least]
    refined, new_target = refine_by_swaps(best, target, run, max_effects)
    if pairs:
        return refined, new_target
    if refined.fit.noise.order:
        refined, new_target = _add_pair(refined, new_target, run, max_effects)
    return _replace_two(refined, new_target, run, max_effects)


def _add_pair(
    hypothesis: Hypothesis, target: Target, run: DiagnosisRun, max_effects: int
) -> tuple[Hypothesis, Target]:
    """Add two effects at once to a hypothesis that leaves coloured noise, if that gains enough for both.

    The noise model may take the response to one of them for noise, as long as the other one is missing.
    """
    min_gain = 2.0 * _get_min_further_gain(target, run.effects)
    others = _list_others(hypothesis, run)
    ranked = rank_pairs(hypothesis.fit, target, others, PAIR_SEEDS, PAIR_SEEDS)
    followed = [each for each in ranked if each.gain > MIN_LINEAR_GAIN * min_gain]
    pairs = [add_pair(hypothesis, each, target, run) for each in followed]
    beam, refitted = _refit_pairs(pairs, target, run)
    if not beam or beam[0].cost > hypothesis.cost - min_gain:
        return hypothesis, target
    is_weak = not hypothesis.effects or ranked[0].gain <= min_gain
    if is_weak and beam[0].fit.noise.order:
        # Any two effects explain a part of coloured noise.
        return hypothesis, target
    found, refitted = refine_by_swaps(beam[0], refitted, run, max_effects)
    is_better = _count_causes(found) <= max_effects and found.cost < hypothesis.cost - min_gain
    return (found, refitted) if is_better else (hypothesis, target)


def _replace_two(
    hypothesis: Hypothesis, target: Target, run: DiagnosisRun, max_effects: int
) -> tuple[Hypothesis, Target]:
    """Replace two effects by two others at once, as long as the cost decreases.

    Two effects may imitate two others, so that no other effect takes the place of one of them.
    """
    min_gain = _get_min_further_gain(target, run.effects)
    while len(hypothesis.effects) > 1:
        run.progress("screening alternatives to two causes")
        effects, others, pairs = hypothesis.effects, _list_others(hypothesis, run), []
        reduced = remove_each(hypothesis, effects[:-1], target, run.parallel_map)
        for place, without in enumerate(reduced, start=1):
            for rest in remove_each(without, effects[place:], target, run.parallel_map):
                ranked = rank_pairs(rest.fit, target, others, REPLACED_PAIRS, PAIRS_OF_EFFECT)
                pairs += [add_pair(rest, each, target, run) for each in ranked]
        beam, refitted = _refit_pairs(pairs, target, run)
        if not beam or beam[0].cost > hypothesis.cost + min_gain:
            break
        found, refitted = refine_by_swaps(beam[0], refitted, run, max_effects)
        if not found.cost < hypothesis.cost - SCORE_TIE:
            break
        hypothesis, target = found, refitted
    return hypothesis, target


def _refit_pairs(
    pairs: Iterable[Hypothesis | None], target: Target, run: DiagnosisRun
) -> tuple[list[Hypothesis], Target]:
    """Refit the best hypotheses to which a pair was added, with their noise model."""
    found = sorted((each for each in pairs if each is not None), key=attrgetter("rank"))
    return refit_with_ar_noise(found[:BEAM_WIDTH], target, run.parallel_map)


def _list_others(hypothesis: Hypothesis, run: DiagnosisRun) -> list[Effect]:
    """Return the effects that a hypothesis does not have and whose responses are known."""
    return [each for each in run.without_effects(hypothesis.effects).effects if not each.is_tuned]


def _extend_beam(
    candidates: Iterable[tuple[Hypothesis, Sequence[ScreenedEffect]]], min_gain: float | None
) -> list[Hypothesis]:
    """Return each hypothesis with each of its candidates, the best first; of equal sets of effects the best.

    Parameters
    ----------
    min_gain : float or None
        Least decrease of the cost; None to accept all candidates.
    """
    extended: dict[frozenset[str], Hypothesis] = {}
    for hypothesis, effects in candidates:
        for each in effects:
            found = with_effect(hypothesis, each)
            key = frozenset(effect.name for effect in found.effects)
            is_accepted = min_gain is None or found.cost < hypothesis.cost - min_gain
            if is_accepted and (key not in extended or found.cost < extended[key].cost):
                extended[key] = found
    return sorted(extended.values(), key=attrgetter("rank"))


def _count_causes(hypothesis: Hypothesis) -> int:
    """Count the effects of a hypothesis, not counting the model-form error of an identified model."""
    return sum(effect.cause != catalogue.CORE_SHAPE for effect in hypothesis.effects)


def refit_with_ar_noise(
    beam: list[Hypothesis], target: Target, parallel_map: ParallelMap = map
) -> tuple[list[Hypothesis], Target]:
    """Refit hypotheses, whitened by the noise model of the best one, until its cost stops decreasing."""
    for _ in range(MAX_REFITS if beam and target.effective_samples is None else 0):
        before = beam[0].cost
        target = whiten_target(target, beam[0].fit)
        tasks = [(each.fit.simulation, [each.fit.values]) for each in beam]
        fits = calibrate_all(StartsCalibrator(target), tasks, parallel_map)
        refitted = [
            min(each, each.with_fit(fit), key=attrgetter("rank"))
            for each, fit in zip(beam, fits, strict=True)
        ]
        beam = sorted(refitted, key=attrgetter("rank"))
        if beam[0].cost > before - SCORE_TIE:
            break
    return beam, target


def refine_by_swaps(
    hypothesis: Hypothesis,
    target: Target,
    run: DiagnosisRun,
    max_effects: int = MAX_EFFECTS,
) -> tuple[Hypothesis, Target]:
    """Refine a hypothesis: remove effects that are not needed, replace effects by better ones, and add more.

    The first effects of a stepwise search may be wrong and become redundant, and after their removal others
    may be worth adding. The cost decreases with every step, so that the refinement ends.

    Parameters
    ----------
    hypothesis : Hypothesis
        A hypothesis to which no single effect is worth adding, or which has the maximum number of effects.
    """
    complete = hypothesis.effects
    min_gain = _get_min_further_gain(target, run.effects)
    hypothesis = eliminate_backward(hypothesis, target, min_gain, run)
    while hypothesis.effects:
        alternatives: tuple[Alternatives, ...] = ()
        candidates = []
        if len(hypothesis.effects) > 1:
            run.progress("screening alternative causes")
            alternatives = find_alternatives(hypothesis, target, run)
            candidates = [
                with_effect(each.without, screened) for each in alternatives for screened in each.screened[:1]
            ]
        if len(hypothesis.effects) < len(complete) and _count_causes(hypothesis) < max_effects:
            larger = [
                with_effect(hypothesis, screened) for screened in screen_others(hypothesis, target, run)[:1]
            ]
            candidates += [each for each in larger if each.cost < hypothesis.cost - min_gain]
        best = min(candidates, key=attrgetter("rank"), default=hypothesis)
        if best.cost > hypothesis.cost - SCORE_TIE:
            other = _find_smaller(hypothesis, alternatives, target, min_gain, run)
            if other is None and _count_causes(hypothesis) < max_effects:
                other = _split_effect(hypothesis, target, min_gain, run)
            if other is None:
                return replace(hypothesis, alternatives=alternatives), target
            complete = other.effects
            (hypothesis,), target = refit_with_ar_noise([other], target)
            continue
        if set(best.effects) == set(hypothesis.effects) and best.cost > hypothesis.cost - MIN_GAIN:
            # Same effects with slightly better values: another pass would not find others.
            refined = replace(hypothesis, fit=best.fit, cost=best.cost, alternatives=alternatives)
            return refined, target
        complete = best.effects
        best = eliminate_backward(best, target, min_gain, run)
        (hypothesis,), target = refit_with_ar_noise([best], target)
    return hypothesis, target


def _find_smaller(
    hypothesis: Hypothesis,
    alternatives: Sequence[Alternatives],
    target: Target,
    min_gain: float,
    run: DiagnosisRun,
) -> Hypothesis | None:
    """Return a hypothesis with fewer effects, one of which takes the place of two; None if none is as good.

    An effect has to gain enough over the best hypothesis with one effect less, also over one with others.
    """
    limit = hypothesis.cost + min_gain
    replaced = [
        with_effect(each.without, screened)
        for each in alternatives
        for screened in each.screened[: BEAM_WIDTH + 1]
        if screened.effect not in hypothesis.effects
    ]
    near = [each for each in replaced if each.cost < limit]
    reduced = [eliminate_backward(each, target, min_gain, run) for each in near]
    smaller = [each for each in reduced if each.cost < limit and len(each.effects) < len(hypothesis.effects)]
    return min(smaller, key=attrgetter("rank"), default=None)


def _split_effect(
    hypothesis: Hypothesis, target: Target, min_gain: float, run: DiagnosisRun
) -> Hypothesis | None:
    """Return a hypothesis with two effects of a family in place of one with more values; None if not better.

    An effect that imitates two others explains more than either of them: the beam does not reach both.
    """
    if target.effective_samples is not None:
        return None
    fit, found = hypothesis.fit, []
    flexible = [each for each in hypothesis.effects if count_degrees(each, fit) > 2]
    reduced = remove_each(hypothesis, flexible, target, run.parallel_map)
    for effect, without in zip(flexible, reduced, strict=True):
        others = [each for each in run.effects if each.family == effect.family and each is not effect]
        family = run.with_effects(others)
        firsts = [with_effect(without, each) for each in screen_others(without, target, family)[:BEAM_WIDTH]]
        found += _extend_beam(((first, screen_others(first, target, family)[:1]) for first in firsts), None)
    better = [each for each in found if each.cost < hypothesis.cost - min_gain]
    return min(better, key=attrgetter("rank"), default=None)


def _get_min_further_gain(target: Target, effects: Sequence[Effect]) -> float:
    """Return the minimum score gain of an effect that is added to others.

    It includes a correction for multiple comparisons, since any of the effects could gain by chance. Under
    model error there is no correction: gains are not due to chance, and pairs need a lower threshold.
    """
    return (
        MIN_GAIN
        if target.effective_samples is not None
        else MIN_GAIN + 2.0 * float(np.log(max(len(effects), 1)))
    )


def eliminate_backward(
    hypothesis: Hypothesis, target: Target, min_gain: float, run: DiagnosisRun
) -> Hypothesis:
    """Remove effects that are redundant given the others, and sort the rest, the most important first.

    The last effect may be removed too: refitted values and the noise model estimated with it may make it
    unnecessary.
    """
    while hypothesis.effects:
        reduced = remove_each(hypothesis, hypothesis.effects, target, run.parallel_map)
        without = {effect.name: each for effect, each in zip(hypothesis.effects, reduced, strict=True)}
        cheapest = min(without.values(), key=attrgetter("rank"))
        threshold = min_gain if len(hypothesis.effects) > 1 else MIN_GAIN
        if cheapest.cost - hypothesis.cost >= threshold:
            ranked = sorted(hypothesis.effects, key=lambda effect: -without[effect.name].cost)
            return Hypothesis(hypothesis.fit, hypothesis.cost, tuple(ranked))
        hypothesis = cheapest
    return hypothesis
