"""Explanations of a record: calibrated simulations with effects, and their separation by other inputs."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.planning.channel_noise import ChannelNoise, NoiseOrigin
from islands.diagnosis.planning.experiment import Experiment, ExperimentModel, MeasuredChannel
from islands.diagnosis.planning.noise_free_fit import MAX_EVALUATIONS, fit_noise_free
from islands.diagnosis.planning.pair_separation import PairSeparation
from islands.diagnosis.planning.separation import require_separation
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.records.noise_model import fit_noise
from islands.records.segments import find_bounds


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """A calibrated simulation with effects, one of which another explanation does not have.

    Attributes
    ----------
    effect : Effect
        The effect in which the explanations differ.
    experiment : Experiment
        Experiment whose simulation is the calibrated one.
    effects : tuple of Effect
        All effects, in the order of the catalogue.
    values : ndarray, shape (parameters,)
        Calibrated values, for one recording.
    """

    effect: Effect
    experiment: Experiment
    effects: tuple[Effect, ...]
    values: Signal

    def with_input(self, u: Signal) -> ExperimentModel:
        """Return the simulation with another input."""
        return ExperimentModel(self.experiment.with_input(u), self.effects)


@dataclass(frozen=True, slots=True, eq=False)
class ExplanationPair:
    """Two explanations of a record that it does not tell apart."""

    one: Explanation
    other: Explanation

    @property
    def names(self) -> tuple[str, str]:
        """Names of the causes in which they differ."""
        return self.one.effect.cause, self.other.effect.cause

    def separate(self, u: Signal, max_evaluations: int = MAX_EVALUATIONS) -> PairSeparation:
        """Return how far an input separates both, in the direction in which it is harder.

        Each explanation is calibrated to the output that the other one predicts, as a diagnosis would do.

        Parameters
        ----------
        u : ndarray, shape (samples,)
        max_evaluations : int
            Maximum number of evaluations of each fit.
        """
        one, other = self.one.with_input(u), self.other.with_input(u)
        # A trial of a fit may be so far away that squares overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            found = (
                _separate(one, self.one, other, self.other, max_evaluations),
                _separate(other, self.other, one, self.one, max_evaluations),
            )
        return min(found, key=lambda each: each.sufficiency)


def _separate(
    truth: ExperimentModel, true: Explanation, rival: ExperimentModel, other: Explanation, evaluations: int
) -> PairSeparation:
    """Return the expected separation of data of one explanation from another one."""
    required = require_separation(truth.experiment, true.effect, other.effect)
    observed = truth.simulate(true.values[None])[0]
    if not np.isfinite(observed).all():
        return PairSeparation(0.0, required)  # an input on which a cause diverges is no experiment
    fit = fit_noise_free(rival, observed, [other.values], evaluations)
    deviations = truth.inverse_prior_std * (true.values - truth.output.nominal)
    squared = fit.squared_distance - float(deviations @ deviations)
    return PairSeparation(sqrt(max(squared, 0.0)) if np.isfinite(squared) else 0.0, required)


def pair_explanations(
    best: CalibrationResult, alternatives: Sequence[tuple[Effect, CalibrationResult]], target: Target
) -> tuple[ExplanationPair, ...]:
    """Pair the best explanation of a record with others, each of which lacks an effect of the best one.

    Parameters
    ----------
    best : CalibrationResult
    alternatives : sequence of (Effect, CalibrationResult)
        Further effects, and simulations that have one of them in place of an effect of the best one.
    target : Target
        The record that they explain.
    """
    noise = _estimate_noise(best, target)
    pairs = []
    for effect, fit in alternatives:
        others = fit.simulation.effects
        replaced = [each for each in best.simulation.effects if each not in others]
        if replaced:
            one = _explain(replaced[0], best, target, noise)
            pairs.append(ExplanationPair(one, _explain(effect, fit, target, noise)))
    return tuple(pairs)


def _estimate_noise(best: CalibrationResult, target: Target) -> ChannelNoise:
    """Estimate the noise as the residual of the best explanation."""
    residual = (target.y - best.output)[target.estimation_part]
    # A difference of fractional order would have no stationary variance, nor a pole on the unit circle.
    model = fit_noise(residual, segments=target.fitted_segments, difference_orders=())
    return ChannelNoise(model.limit_poles(residual.size), NoiseOrigin.RESIDUAL)


def _explain(effect: Effect, fit: CalibrationResult, target: Target, noise: ChannelNoise) -> Explanation:
    simulation = fit.simulation
    context = simulation.context
    channel = MeasuredChannel("output", context.output_unit, simulation.simulator, context, noise)
    experiment = Experiment((channel,), target.prior_std, target.fitted)
    return Explanation(effect, experiment, simulation.effects, fit.values[~simulation.is_copy])


def take_longest_input(u: Signal, segments: Sequence[int], most: int) -> Signal:
    """Return the input of the longest recording, or its first ``most`` samples."""
    first, last = max(find_bounds(segments, u.size), key=lambda each: each[1] - each[0])
    return u[first : min(last, first + most)]
