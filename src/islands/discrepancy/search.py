"""The search for causes: single effects and combinations, a few of them followed at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from islands.discrepancy.calibration import Calibrated, Target, calibrate
from islands.discrepancy.effect import Effect
from islands.discrepancy.effects import in_order
from islands.discrepancy.ladder import Rung, carried, ladder, price

#: The least that an effect has to gain, in minus twice the log-likelihood: six is one to twenty.
LEAST = 6.0

#: Combinations that are followed at a time, and effects in one.
BEAM, MOST = 3, 3

#: Told what is being done.
Tell: TypeAlias = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """A simulation with the effects that explain a record best.

    Attributes
    ----------
    fit : Calibrated
    cost : float
        Its score with every effect's values paid for: less is better.
    effects : tuple of Effect
        The most important first.
    """

    fit: Calibrated
    cost: float
    effects: tuple[Effect, ...]


def explained(
    base: Calibrated, first: Sequence[Rung], target: Target, effects: Sequence[Effect], tell: Tell
) -> Explanation:
    """Return the best explanation: from the simulation alone, effect after effect, as long as that pays.

    Parameters
    ----------
    base : Calibrated
        The simulation alone.
    first : sequence of Rung
        Its ladder.
    """
    best = Explanation(base, base.score, ())
    followed = [best]
    while followed and len(followed[0].effects) < MOST:
        if followed[0].effects:
            tell(f"effects beside {' and '.join(effect.name for effect in followed[0].effects)}")
        further: dict[frozenset[str], Explanation] = {}
        for each in followed:
            others = [effect for effect in effects if effect not in each.effects]
            rungs = ladder(each.fit, target, others) if each.effects else first
            for rung in rungs[:BEAM]:
                found = _extended(each, rung)
                key = frozenset(effect.name for effect in found.effects)
                if found.cost < each.cost - LEAST and (key not in further or found.cost < further[key].cost):
                    further[key] = found
        followed = sorted(further.values(), key=lambda each: each.cost)[:BEAM]
        if not followed or followed[0].cost > best.cost - LEAST:
            break
        best = followed[0]
    return _thinned(best, target)


def _extended(before: Explanation, rung: Rung) -> Explanation:
    cost = before.cost - rung.gained(before.fit)
    return Explanation(rung.fit, cost, (*before.effects, rung.effect))


def _thinned(found: Explanation, target: Target) -> Explanation:
    """Leave out what is not needed any more beside what came later, and put the most important first."""
    while len(found.effects) > 1:
        without = {effect.name: without_effect(found, effect, target) for effect in found.effects}
        cheapest = min(without.values(), key=lambda each: each.cost)
        if cheapest.cost - found.cost >= LEAST:
            ranked = sorted(found.effects, key=lambda effect: -without[effect.name].cost)
            return Explanation(found.fit, found.cost, tuple(ranked))
        found = cheapest
    return found


def without_effect(found: Explanation, effect: Effect, target: Target) -> Explanation:
    """Return an explanation without one of its effects, fitted anew."""
    fit = found.fit
    left = tuple(each for each in found.effects if each is not effect)
    simulation = fit.simulation.with_effects(in_order(left))
    again = calibrate(simulation, target, carried(fit.values, fit.simulation, simulation))
    return Explanation(again, again.score + (found.cost - fit.score) - price(effect, fit), left)
