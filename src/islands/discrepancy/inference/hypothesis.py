"""Hypothesis: a simulation with the effects that explain a record, and the alternatives to each effect."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.discrepancy.calibration.target import Target
from islands.discrepancy.effects import catalogue_order
from islands.discrepancy.inference.screening import (
    SCORE_TIE,
    ScreenedEffect,
    bic_penalty,
    screen_effects,
    transfer_parameters,
)
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A calibrated simulation with a set of effects.

    Attributes
    ----------
    fit : CalibrationResult
    cost : float
        Score of the fit plus the BIC penalties of its effects; less is better.
    effects : tuple of Effect
        The effects, the most important first.
    alternatives : tuple of Alternatives
        Alternatives to each effect; empty if they were not computed.
    """

    fit: CalibrationResult
    cost: float
    effects: tuple[Effect, ...]
    alternatives: "tuple[Alternatives, ...]" = ()

    @property
    def rank(self) -> int:
        """Cost in units of `SCORE_TIE`, rounded; hypotheses of equal rank keep their order."""
        return round(self.cost / SCORE_TIE)


@dataclass(frozen=True, slots=True, eq=False)
class Alternatives:
    """Effects that could replace one effect of a hypothesis.

    Attributes
    ----------
    without : Hypothesis
        The hypothesis without the effect, refitted.
    screened : sequence of ScreenedEffect
        Each effect that is not in that hypothesis, the removed one included, added to it; the best first.
    """

    without: Hypothesis
    screened: Sequence[ScreenedEffect]


def with_effect(hypothesis: Hypothesis, screened: ScreenedEffect) -> Hypothesis:
    """Return a hypothesis with one more effect."""
    cost = hypothesis.cost - screened.score_gain(hypothesis.fit)
    return Hypothesis(screened.fit, cost, (*hypothesis.effects, screened.effect))


def refit(hypothesis: Hypothesis, target: Target) -> Hypothesis:
    """Calibrate a hypothesis to a target, and return it unchanged if that does not improve its rank."""
    fit = calibrate(hypothesis.fit.simulation, target, hypothesis.fit.values)
    refitted = Hypothesis(fit, hypothesis.cost + fit.score - hypothesis.fit.score, hypothesis.effects)
    return refitted if refitted.rank < hypothesis.rank else hypothesis


def without_effect(hypothesis: Hypothesis, effect: Effect, target: Target) -> Hypothesis:
    """Return a hypothesis without one of its effects, refitted."""
    fit = hypothesis.fit
    remaining = tuple(each for each in hypothesis.effects if each is not effect)
    simulation = fit.simulation.with_effects(catalogue_order(remaining))
    refitted = calibrate(simulation, target, transfer_parameters(fit.values, fit.simulation, simulation))
    if not np.isfinite(refitted.score):  # the simulation diverges at these values without the effect
        refitted = calibrate(simulation, target, simulation.nominal)
    cost = refitted.score + (hypothesis.cost - fit.score) - bic_penalty(effect, fit)
    return Hypothesis(refitted, cost, remaining)


def find_alternatives(
    hypothesis: Hypothesis, target: Target, effects: Sequence[Effect], parallel_map: ParallelMap = map
) -> tuple[Alternatives, ...]:
    """Remove each effect in turn, and screen the effects that could take its place, itself included."""
    alternatives = []
    for effect in hypothesis.effects:
        without = without_effect(hypothesis, effect, target)
        others = [each for each in effects if each not in without.effects]
        alternatives.append(Alternatives(without, screen_effects(without.fit, target, others, parallel_map)))
    return tuple(alternatives)
