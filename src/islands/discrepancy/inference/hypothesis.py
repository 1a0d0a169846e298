"""An explanation: a simulation with effects that a record asks for, and what could stand in their place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.effects import catalogue_order
from islands.discrepancy.inference.screening import (
    EQUAL,
    ScreenedEffect,
    bic_penalty,
    screen_effects,
    transfer_parameters,
)
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A simulation with the effects that explain a record best.

    Attributes
    ----------
    fit : CalibrationResult
    cost : float
        Its score with every effect's values paid for: less is better.
    effects : tuple of Effect
        The most important first.
    alternatives : tuple of Alternatives
        Of each effect; empty where they were not asked for.
    """

    fit: CalibrationResult
    cost: float
    effects: tuple[Effect, ...]
    alternatives: "tuple[Alternatives, ...]" = ()

    @property
    def rank(self) -> int:
        """Its cost, to what can be told apart: equal ones stand in the order in which they were found."""
        return round(self.cost / EQUAL)


@dataclass(frozen=True, slots=True, eq=False)
class Alternatives:
    """What could stand in the place of an effect.

    Attributes
    ----------
    without : Hypothesis
        All the others, fitted anew.
    screened : sequence of ScreenedEffect
        Each effect beside them, the best first.
    """

    without: Hypothesis
    screened: Sequence[ScreenedEffect]


def with_effect(before: Hypothesis, rung: ScreenedEffect) -> Hypothesis:
    """Return an explanation with a rung's effect in it."""
    cost = before.cost - rung.score_gain(before.fit)
    return Hypothesis(rung.fit, cost, (*before.effects, rung.effect))


def refit(found: Hypothesis, target: Target) -> Hypothesis:
    """Return an explanation, fitted anew where that is better."""
    fit = calibrate(found.fit.simulation, target, found.fit.values)
    other = Hypothesis(fit, found.cost + fit.score - found.fit.score, found.effects)
    return other if other.rank < found.rank else found


def without_effect(found: Hypothesis, effect: Effect, target: Target) -> Hypothesis:
    """Return an explanation without one of its effects, fitted anew."""
    fit = found.fit
    left = tuple(each for each in found.effects if each is not effect)
    simulation = fit.simulation.with_effects(catalogue_order(left))
    alone = calibrate(simulation, target, transfer_parameters(fit.values, fit.simulation, simulation))
    if not np.isfinite(alone.score):  # with the others' values it explodes: the effect held it in check
        alone = calibrate(simulation, target, simulation.nominal)
    return Hypothesis(alone, alone.score + (found.cost - fit.score) - bic_penalty(effect, fit), left)


def find_alternatives(
    found: Hypothesis, target: Target, effects: Sequence[Effect], spread: ParallelMap = map
) -> tuple[Alternatives, ...]:
    """Take each effect out, and try all others in its place."""
    rivals = []
    for effect in found.effects:
        without = without_effect(found, effect, target)
        others = [each for each in effects if each not in without.effects]
        rivals.append(Alternatives(without, screen_effects(without.fit, target, others, spread)))
    return tuple(rivals)
