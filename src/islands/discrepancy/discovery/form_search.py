"""Search for free forms that explain a record clearly better than named effects.

A named effect is claimed only if its shape is that of the record: a free form of the same or another family,
in its place or in addition, must not explain much more.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult
from islands.discrepancy.calibration.target import Target
from islands.discrepancy.inference.finding import EQUIVALENCE_MARGIN, compute_form_chance
from islands.discrepancy.inference.hypothesis import Alternatives, Hypothesis, remove_each, with_effect
from islands.discrepancy.inference.screening import ScreenedEffect, screen_effects
from islands.discrepancy.inference.stepwise_search import (
    MAX_EFFECTS,
    eliminate_backward,
    refine_by_swaps,
    refit_with_ar_noise,
)
from islands.discrepancy.inference.strategies import SearchOutcome, assess_evidence
from islands.discrepancy.inference.verdict import Verdict
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.evolution.progress import ignore_progress

#: Fraction of the misfit that free forms explain, from which named effects are claimed. A form of the
#: catalogue is an idealisation, such as a smoothed sign for dry friction.
MIN_NAMED_FRACTION = 0.9

#: Maximum number of free forms of a hypothesis.
MAX_FORMS = 2

#: Number of free forms, the best ones, that may replace all effects.
MAX_REPLACEMENTS = 3


def compare_with_free_forms(
    outcome: SearchOutcome,
    forms: Sequence[Effect],
    effects: Sequence[Effect],
    rng: np.random.Generator,
    parallel_map: ParallelMap,
) -> SearchOutcome:
    """Return the outcome with free forms if they explain clearly more and withstand the same tests.

    Otherwise the forms are only added to the alternatives of a single effect.
    """
    named = [effect for effect in effects if not effect.is_free]
    freer = search_free_forms(outcome, forms, named, parallel_map)
    if freer.hypothesis is not outcome.hypothesis:
        assessed = assess_evidence(freer, effects, rng)
        has_forms = any(effect.is_free for effect in assessed.hypothesis.effects)
        if has_forms and assessed.verdict != Verdict.UNKNOWN:
            return assessed
    return replace(outcome, screened=freer.screened, form_alternatives=freer.form_alternatives)


def search_free_forms(
    outcome: SearchOutcome,
    forms: Sequence[Effect],
    named: Sequence[Effect] = (),
    parallel_map: ParallelMap = map,
) -> SearchOutcome:
    """Replace effects by free forms, or add free forms, as long as these explain clearly more.

    One free form that fits better than several effects replaces them: it is one cause instead of several.
    Named effects are then searched for again, in addition to the others and instead of each of several ones:
    their residual had contained the shape of the forms.

    Parameters
    ----------
    outcome : SearchOutcome
        Result of a search for named effects.
    forms : sequence of Effect
        Free forms that apply to the simulation.
    named : sequence of Effect
        Effects to be searched for with forms.
    parallel_map : ParallelMap
        Calibrates the extended simulations.

    Returns
    -------
    SearchOutcome
        Outcome with free forms, not assessed yet, or with the same hypothesis if the named effects explain as
        much. The screening of the forms is added to that of the effects.
    """
    base = outcome.base
    alone = Hypothesis(base, base.score, ())
    screened = screen_effects(base, outcome.target, forms, parallel_map)
    found, target = _replace_by_one_form(outcome, alone, screened)
    alternatives: dict[str, Alternatives] = {}
    for _ in range(MAX_FORMS):
        starts = [Alternatives(alone, screened)]
        if found.effects:
            starts.append(_screen_forms(found, forms, target, parallel_map))
        if len(found.effects) > 1:
            reduced = remove_each(found, found.effects, target, parallel_map)
            alternatives = {
                effect.name: _screen_forms(without, forms, target, parallel_map)
                for effect, without in zip(found.effects, reduced, strict=True)
                if not effect.is_free
            }
        extended = [
            eliminate_backward(
                with_effect(each.without, each.screened[0]), target, EQUIVALENCE_MARGIN, parallel_map
            )
            for each in (*starts, *alternatives.values())
            if each.screened
        ]
        beam, refitted = refit_with_ar_noise(sorted(extended, key=attrgetter("rank")), target, parallel_map)
        if not beam or not _explains_more(beam[0], found, outcome):
            break
        found, target, alternatives = beam[0], refitted, {}
    if found is not outcome.hypothesis:
        found, target = _add_named_effects(found, target, named, parallel_map)
    merged = _merge(base, outcome.screened, screened)
    return replace(outcome, hypothesis=found, target=target, screened=merged, form_alternatives=alternatives)


def _screen_forms(
    without: Hypothesis, forms: Sequence[Effect], target: Target, parallel_map: ParallelMap
) -> Alternatives:
    """Screen the free forms that a hypothesis does not have."""
    unused = [form for form in forms if form not in without.effects]
    return Alternatives(without, screen_effects(without.fit, target, unused, parallel_map))


def _replace_by_one_form(
    outcome: SearchOutcome, alone: Hypothesis, screened: Sequence[ScreenedEffect]
) -> tuple[Hypothesis, Target]:
    """Return the hypothesis with one free form if that fits clearly better than all effects, else these.

    A single effect that is a special case of the form is left to `_explains_more`.
    """
    found, target = outcome.hypothesis, outcome.target
    for each in screened[:MAX_REPLACEMENTS] if found.effects else ():
        if len(found.effects) == 1 and found.effects[0].cause in each.effect.special_cases:
            continue
        (single,), refitted = refit_with_ar_noise([with_effect(alone, each)], outcome.target)
        chance = compute_form_chance(each.effect, found.effects, found.fit)
        if single.fit.score < found.fit.score - chance - EQUIVALENCE_MARGIN:
            found, target = single, refitted
    return found, target


def _add_named_effects(
    found: Hypothesis, target: Target, named: Sequence[Effect], parallel_map: ParallelMap
) -> tuple[Hypothesis, Target]:
    """Add named effects to a hypothesis with free forms, and replace each of its effects by better ones.

    A form is an approximation: an added effect has to explain more than what that leaves.
    """
    forms = [effect for effect in found.effects if effect.is_free]
    while len(found.effects) < MAX_EFFECTS:
        others = [effect for effect in named if effect not in found.effects]
        screened = screen_effects(found.fit, target, others, parallel_map)
        larger = [with_effect(found, each) for each in screened[:1]]
        beam, refitted = refit_with_ar_noise(larger, target)
        if not beam or beam[0].cost > found.cost - EQUIVALENCE_MARGIN:
            break
        if beam[0].fit.mean_square > MIN_NAMED_FRACTION * found.fit.mean_square:
            break
        found, target = beam[0], refitted
    if len(found.effects) == 1:
        return found, target
    return refine_by_swaps(found, target, [*named, *forms], ignore_progress, parallel_map)


def _explains_more(new: Hypothesis, old: Hypothesis, outcome: SearchOutcome) -> bool:
    """Return whether a hypothesis is better than another one by the margin of equivalents and in size."""
    before = outcome.base.mean_square
    explained = before - old.fit.mean_square
    is_larger = explained < MIN_NAMED_FRACTION * (before - new.fit.mean_square)
    return new.cost < old.cost - EQUIVALENCE_MARGIN and is_larger


def _merge(
    base: CalibrationResult, one: Sequence[ScreenedEffect], other: Sequence[ScreenedEffect]
) -> list[ScreenedEffect]:
    """Return screened effects and forms, the best first."""
    return sorted((*one, *other), key=lambda each: -each.score_gain(base))
