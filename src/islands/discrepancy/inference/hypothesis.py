"""An explanation: a simulation with effects that a record asks for, and what could stand in their place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import Calibrated, Target, calibrate
from islands.discrepancy.effects import in_order
from islands.discrepancy.inference.screening import EQUAL, Rung, carried, ladder, price
from islands.discrepancy.interfaces.effect import Effect
from islands.parallel import Spread


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
    rivals : tuple of Rivals
        Of each effect; empty where they were not asked for.
    """

    fit: Calibrated
    cost: float
    effects: tuple[Effect, ...]
    rivals: "tuple[Rivals, ...]" = ()

    @property
    def rank(self) -> int:
        """Its cost, to what can be told apart: equal ones stand in the order in which they were found."""
        return round(self.cost / EQUAL)


@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
    """What could stand in the place of an effect.

    Attributes
    ----------
    without : Explanation
        All the others, fitted anew.
    rungs : sequence of Rung
        Each effect beside them, the best first.
    """

    without: Explanation
    rungs: Sequence[Rung]


def extended(before: Explanation, rung: Rung) -> Explanation:
    """Return an explanation with a rung's effect in it."""
    cost = before.cost - rung.gained(before.fit)
    return Explanation(rung.fit, cost, (*before.effects, rung.effect))


def refitted(found: Explanation, target: Target) -> Explanation:
    """Return an explanation, fitted anew where that is better."""
    fit = calibrate(found.fit.simulation, target, found.fit.values)
    other = Explanation(fit, found.cost + fit.score - found.fit.score, found.effects)
    return other if other.rank < found.rank else found


def without_effect(found: Explanation, effect: Effect, target: Target) -> Explanation:
    """Return an explanation without one of its effects, fitted anew."""
    fit = found.fit
    left = tuple(each for each in found.effects if each is not effect)
    simulation = fit.simulation.with_effects(in_order(left))
    alone = calibrate(simulation, target, carried(fit.values, fit.simulation, simulation))
    if not np.isfinite(alone.score):  # with the others' values it explodes: the effect held it in check
        alone = calibrate(simulation, target, simulation.nominal)
    return Explanation(alone, alone.score + (found.cost - fit.score) - price(effect, fit), left)


def rivals_of(
    found: Explanation, target: Target, effects: Sequence[Effect], spread: Spread = map
) -> tuple[Rivals, ...]:
    """Take each effect out, and try all others in its place."""
    rivals = []
    for effect in found.effects:
        without = without_effect(found, effect, target)
        others = [each for each in effects if each not in without.effects]
        rivals.append(Rivals(without, ladder(without.fit, target, others, spread)))
    return tuple(rivals)
