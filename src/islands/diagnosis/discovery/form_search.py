"""Search for free forms that explain a record clearly better than named effects.

A named effect is claimed only if its shape is that of the record: a free form of the same or another family,
in its place or in addition, must not explain much more.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.finding import EQUIVALENCE_MARGIN, compute_form_chance
from islands.diagnosis.inference.hypothesis import (
    Alternatives,
    Hypothesis,
    remove_each,
    screen_others,
    with_effect,
)
from islands.diagnosis.inference.screening import ScreenedEffect, screen_effects
from islands.diagnosis.inference.stepwise_search import (
    MAX_EFFECTS,
    eliminate_backward,
    refine_by_swaps,
    refit_with_ar_noise,
)
from islands.diagnosis.inference.strategies import SearchOutcome, assess_evidence
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.effect import Effect
from islands.progress import ignore_progress

#: Fraction of the misfit that free forms explain, from which named effects are claimed. A form of the
#: catalogue is an idealisation, such as a smoothed sign for dry friction.
MIN_NAMED_FRACTION = 0.9

#: Maximum number of free forms of a hypothesis.
MAX_FORMS = 2

#: Number of free forms, the best ones, that may replace all effects.
MAX_REPLACEMENTS = 3


def compare_with_free_forms(
    outcome: SearchOutcome, forms: Sequence[Effect], run: DiagnosisRun
) -> SearchOutcome:
    """Return the outcome with free forms if they explain clearly more and withstand the same tests.

    Otherwise the forms are only added to the alternatives of a single effect.
    """
    freer = search_free_forms(outcome, forms, run)
    if freer.hypothesis is not outcome.hypothesis:
        assessed = assess_evidence(freer, run.with_effects((*run.effects, *forms)))
        has_forms = any(effect.is_free for effect in assessed.hypothesis.effects)
        if has_forms and assessed.verdict != Verdict.UNKNOWN:
            return assessed
    return replace(outcome, screened=freer.screened, form_alternatives=freer.form_alternatives)


def search_free_forms(outcome: SearchOutcome, forms: Sequence[Effect], run: DiagnosisRun) -> SearchOutcome:
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
    run : DiagnosisRun
        Its effects that are no free forms are searched for with forms.

    Returns
    -------
    SearchOutcome
        Outcome with free forms, not assessed yet, or with the same hypothesis if the named effects explain as
        much. The screening of the forms is added to that of the effects.
    """
    base, of_forms = outcome.base, run.with_effects(forms)
    alone = Hypothesis(base, base.score, ())
    screened = screen_effects(base, outcome.target, of_forms)
    found, target = _replace_by_one_form(outcome, alone, screened)
    alternatives: dict[str, Alternatives] = {}
    for _ in range(MAX_FORMS):
        starts = [Alternatives(alone, screened)]
        if found.effects:
            starts.append(Alternatives(found, screen_others(found, target, of_forms)))
        if len(found.effects) > 1:
            reduced = remove_each(found, found.effects, target, run.parallel_map)
            alternatives = {
                effect.name: Alternatives(without, screen_others(without, target, of_forms))
                for effect, without in zip(found.effects, reduced, strict=True)
                if not effect.is_free
            }
        extended = [
            eliminate_backward(with_effect(each.without, each.screened[0]), target, EQUIVALENCE_MARGIN, run)
            for each in (*starts, *alternatives.values())
            if each.screened
        ]
        beam, refitted = refit_with_ar_noise(
            sorted(extended, key=attrgetter("rank")), target, run.parallel_map
        )
        if not beam or not _explains_more(beam[0], found, outcome):
            break
        found, target, alternatives = beam[0], refitted, {}
    if found is not outcome.hypothesis:
        found, target = _add_named_effects(found, target, run)
    merged = _merge(base, outcome.screened, screened)
    return replace(outcome, hypothesis=found, target=target, screened=merged, form_alternatives=alternatives)


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


def _add_named_effects(found: Hypothesis, target: Target, run: DiagnosisRun) -> tuple[Hypothesis, Target]:
    """Add named effects to a hypothesis with free forms, and replace each of its effects by better ones.

    A form is an approximation: an added effect has to explain more than what that leaves.
    """
    forms = [effect for effect in found.effects if effect.is_free]
    named = [effect for effect in run.effects if not effect.is_free]
    while len(found.effects) < MAX_EFFECTS:
        screened = screen_others(found, target, run.with_effects(named))
        larger = [with_effect(found, each) for each in screened[:1]]
        beam, refitted = refit_with_ar_noise(larger, target)
        if not beam or beam[0].cost > found.cost - EQUIVALENCE_MARGIN:
            break
        if beam[0].fit.mean_square > MIN_NAMED_FRACTION * found.fit.mean_square:
            break
        found, target = beam[0], refitted
    if len(found.effects) == 1:
        return found, target
    refined = replace(run, effects=[*named, *forms], progress=ignore_progress)
    return refine_by_swaps(found, target, refined)


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
