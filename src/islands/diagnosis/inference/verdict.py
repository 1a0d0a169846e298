"""Verdict: whether effects explain a residual, more than chance does and on blocks that were left out."""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.chance_gain import ForwardSelection, compute_chance_gain, draw_noise
from islands.diagnosis.inference.confounders import find_confounder
from islands.diagnosis.inference.holdout import (
    bound_reduction,
    compute_holdout_errors,
    cross_validate_gain,
)
from islands.diagnosis.inference.hypothesis import Hypothesis, without_effect
from islands.diagnosis.inference.screening import bic_penalty
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect

#: Minimum fraction of the explainable misfit that the effects have to explain.
MIN_EXPLAINED_FRACTION = 0.5

#: The same if the residual still has structure: the rest is then small enough to be called a remainder.
MIN_EXPLAINED_FRACTION_WITH_REMAINDER = 0.9

#: Change of the output in the hold-out part, relative to the error, below which that part says nothing.
MIN_VISIBLE_FRACTION = 0.02

#: Minimum decrease of the mean square by each further effect, relative to the part of a confounder's response
#: that no simulation reproduces.
MIN_CONFOUNDED_FRACTION = 0.1


class Verdict(StrEnum):
    """Verdict of a diagnosis."""

    NOTHING = "nothing"
    NOISE = "noise"
    NAMED = "named"
    REMAINDER = "named with remainder"
    UNKNOWN = "unknown"
    FAMILY = "family"
    DISCOVERED = "discovered"
    GROSS_ERROR = "gross error"
    STOPPED = "stopped"


def remove_chance_effects(
    hypothesis: Hypothesis, base: CalibrationResult, target: Target, effects: Sequence[Effect]
) -> Hypothesis:
    """Remove the effects with gains that the record's noise reaches by chance, the least important first.

    Under model error, causes may mask each other: all of them are kept, or none.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects.
    effects : sequence of Effect
        Effects that were searched for.
    """
    if target.effective_samples is not None and len(hypothesis.effects) > 1:
        gain = base.score - hypothesis.fit.score
        selection = ForwardSelection(base, target, effects, len(hypothesis.effects))
        return hypothesis if gain > selection.compute_chance_gain() else Hypothesis(base, base.score, ())
    has_noise_model, surrogates = target.effective_samples is None, list[Signal]()
    for effect in hypothesis.effects[::-1]:
        fit, without = hypothesis.fit, without_effect(hypothesis, effect, target)
        whitened = replace(target, noise=fit.noise) if has_noise_model else target
        # Without a noise model there is one effect; otherwise all effects of a fit have the same surrogates.
        surrogates = surrogates or draw_noise(fit if has_noise_model else without.fit, whitened)
        gain = without.cost - hypothesis.cost + bic_penalty(effect, fit)
        if gain <= compute_chance_gain(fit, without.fit, effect, whitened, len(effects), surrogates):
            hypothesis, surrogates = without, []
    return hypothesis


def validate_out_of_sample(
    hypothesis: Hypothesis, base: CalibrationResult, target: Target, rng: np.random.Generator
) -> Hypothesis:
    """Remove effects, the least important first, until the rest has a cross-validated gain.

    If a confounder is more likely than one of the effects, also remove further effects that may only fit the
    part of its response that no simulation reproduces.
    """
    while hypothesis.effects:
        reference = choose_reference_fit(hypothesis.effects, base, target)
        keep_values = reference is not base
        if cross_validate_gain(reference, keep_values, hypothesis.fit, target, rng) > 0.0:
            break
        hypothesis = without_effect(hypothesis, hypothesis.effects[-1], target)
    excess = _sum_confounder_excess(hypothesis, target)
    for effect in hypothesis.effects[:0:-1] if excess else ():
        without = without_effect(hypothesis, effect, target)
        decrease = without.fit.mean_square - hypothesis.fit.mean_square
        if decrease < MIN_CONFOUNDED_FRACTION * excess and effect.family != "scale":
            hypothesis = without
    return hypothesis


def withdraw_effects(hypothesis: Hypothesis, target: Target, rng: np.random.Generator) -> Hypothesis:
    """Remove further effects, the least important first, that do not reduce the error of the hold-out part.

    It is for simulations that are still wrong. An effect is kept if the hold-out part cannot show it, as a
    state that does not reach its limit there, and if it is a gain or a parameter, which calibration replaces.
    """
    for effect in hypothesis.effects[:0:-1]:
        if effect.family == "scale":
            continue
        without = without_effect(hypothesis, effect, target)
        before, after = (compute_holdout_errors(each.fit, target) for each in (without, hypothesis))
        is_visible = np.std(after - before) > MIN_VISIBLE_FRACTION * np.std(before)
        if is_visible and bound_reduction(before, after, rng)[0] <= 0.0:
            hypothesis = without
    return hypothesis


def _sum_confounder_excess(hypothesis: Hypothesis, target: Target) -> float:
    """Return the mean square of the parts of likely confounders' responses that no simulation reproduces."""
    confounders = (find_confounder(hypothesis.fit, effect, target) for effect in hypothesis.effects)
    return sum(
        confounder.excess_mean_square
        for confounder in confounders
        if confounder is not None and confounder.score_gain > MIN_GAIN
    )


def choose_reference_fit(
    effects: Sequence[Effect], base: CalibrationResult, target: Target
) -> CalibrationResult:
    """Return the fit that effects are compared with: the calibrated simulation without them.

    Calibration absorbs a wrong gain or parameter. An extension that has only such effects is therefore
    compared with the simulation at its nominal values. Initial states of recordings after the first have no
    nominal values and are those of the calibration.
    """
    if all(effect.family == "scale" for effect in effects):
        simulation = base.simulation
        nominal = np.where(simulation.is_copy, base.values, simulation.nominal)
        return evaluate_fit(simulation, target, nominal)
    return base


def explained_fraction(before: CalibrationResult, after: CalibrationResult, floor: float) -> float:
    """Return the explained fraction of the misfit above ``floor``, the mean square of the noise."""
    misfit = before.mean_square - floor
    if misfit <= 0.0:
        return 0.0
    return float(np.clip((before.mean_square - after.mean_square) / misfit, 0.0, 1.0))


def noise_fraction(before: CalibrationResult, floor: float) -> float:
    """Return the fraction of the mean squared error that is noise, of the mean square ``floor``."""
    return min(floor / before.mean_square, 1.0) if before.mean_square > 0.0 else 1.0


def classify(explained: float, has_effects: bool, has_remainder: bool, is_model_error: bool) -> Verdict:
    """Return the verdict on effects that explain a fraction of the misfit.

    Under model error a remainder is expected, so that `MIN_EXPLAINED_FRACTION` is enough.
    """
    if not has_effects:
        return Verdict.UNKNOWN if has_remainder or is_model_error else Verdict.NOTHING
    required = (
        MIN_EXPLAINED_FRACTION_WITH_REMAINDER
        if has_remainder and not is_model_error
        else MIN_EXPLAINED_FRACTION
    )
    if explained < required:
        return Verdict.UNKNOWN
    return Verdict.REMAINDER if has_remainder else Verdict.NAMED
