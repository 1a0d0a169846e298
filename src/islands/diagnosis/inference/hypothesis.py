"""Hypothesis: a simulation with the effects that explain a record, and the alternatives to each effect."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.starts_calibrator import StartsCalibrator, calibrate_all
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import (
    SCORE_TIE,
    ScreenedEffect,
    bic_penalty,
    screen_effects,
    transfer_parameters,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.effect import Effect
from islands.parallel import ParallelMap


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

    def with_fit(self, fit: CalibrationResult) -> "Hypothesis":
        """Return the hypothesis with another fit of its simulation, without alternatives."""
        return Hypothesis(fit, self.cost + fit.score - self.fit.score, self.effects)


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


def screen_others(
    hypothesis: Hypothesis, target: Target, run: DiagnosisRun, larger: CalibrationResult | None = None
) -> list[ScreenedEffect]:
    """Screen the effects that a hypothesis does not have, in addition to its own; see `screen_effects`."""
    return screen_effects(hypothesis.fit, target, run.without_effects(hypothesis.effects), larger)


def without_effect(hypothesis: Hypothesis, effect: Effect, target: Target) -> Hypothesis:
    """Return a hypothesis without one of its effects, refitted."""
    return remove_each(hypothesis, [effect], target)[0]


def remove_each(
    hypothesis: Hypothesis, effects: Sequence[Effect], target: Target, parallel_map: ParallelMap = map
) -> list[Hypothesis]:
    """Return a hypothesis without each of some of its effects in turn, refitted."""
    fit, reduced = hypothesis.fit, []
    remaining = [tuple(each for each in hypothesis.effects if each is not effect) for effect in effects]
    simulations = [fit.simulation.with_effects(each) for each in remaining]
    tasks = [(each, [transfer_parameters(fit.values, fit.simulation, each)]) for each in simulations]
    fits = calibrate_all(StartsCalibrator(target), tasks, parallel_map)
    for effect, others, simulation, found in zip(effects, remaining, simulations, fits, strict=True):
        # The simulation may diverge at these values without the effect.
        best = found if np.isfinite(found.score) else calibrate(simulation, target, simulation.nominal)
        cost = best.score + (hypothesis.cost - fit.score) - bic_penalty(effect, fit)
        reduced.append(Hypothesis(best, cost, others))
    return reduced


def find_alternatives(hypothesis: Hypothesis, target: Target, run: DiagnosisRun) -> tuple[Alternatives, ...]:
    """Remove each effect in turn, and screen the effects that could take its place, itself included."""
    reduced = remove_each(hypothesis, hypothesis.effects, target, run.parallel_map)
    return tuple(
        Alternatives(without, screen_others(without, target, run, hypothesis.fit)) for without in reduced
    )
