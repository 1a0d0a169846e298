"""Search strategies: the residual is either coloured noise or model error.

The first strategy models the residual as an autoregression. A simulation whose form is wrong leaves more than
that, and any effect that whitens the residual would be selected. The second strategy therefore fits the
unweighted residual and counts its effective sample size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    evaluate_fit,
    whiten_target,
)
from islands.diagnosis.calibration.starts_calibrator import StartsCalibrator, make_task_key
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.cancellation import resolve_cancellation
from islands.diagnosis.inference.chance_gain import ForwardSelection
from islands.diagnosis.inference.curve_ends import MAX_INCREASE, flatten_ends
from islands.diagnosis.inference.hypothesis import Alternatives, Hypothesis, screen_others, with_effect
from islands.diagnosis.inference.noise_floor import (
    MIN_FRACTION,
    explainable_variance,
    noise_variance_from_periods,
)
from islands.diagnosis.inference.residual_structure import find_residual_structure
from islands.diagnosis.inference.resolved_effects import remove_unresolved
from islands.diagnosis.inference.screening import ScreenedEffect, screen_effects
from islands.diagnosis.inference.stepwise_search import MAX_EFFECTS, MIN_GAIN, stepwise_search
from islands.diagnosis.inference.verdict import (
    Verdict,
    choose_reference_fit,
    classify,
    explained_fraction,
    remove_chance_effects,
    validate_out_of_sample,
    withdraw_effects,
)
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CORE_SHAPE
from islands.effects.interface.effect import Effect
from islands.parallel import memoised_map
from islands.records.noise_model import estimate_effective_samples


def centre_values(hypothesis: Hypothesis, target: Target) -> Hypothesis:
    """Set the values of effects that jump to the middle of those with the same response, and fit all others.

    An effect whose likelihood would be lower by more than an interval of 95 % keeps its values: other effects
    change its input.
    """
    fit = hypothesis.fit
    for effect in hypothesis.effects:
        if effect.centre is None:
            continue
        part, start = fit.simulation.get_slice(effect), fit.values.copy()
        start[part] = effect.centre(fit.values[part], fit.simulation.context)
        is_fixed = np.zeros(start.size, dtype=np.bool_)
        is_fixed[part] = True
        centred = calibrate(fit.simulation, target, start, is_fixed=is_fixed)
        if centred.score < fit.score + MAX_INCREASE:
            fit = centred
    cost = hypothesis.cost + fit.score - hypothesis.fit.score
    return replace(hypothesis, fit=fit, cost=cost)


#: Beginning of the messages of a search that takes the residual for model error.
WITH_MODEL_ERROR = "with model error: "

#: Fraction of the misfit that some single effect has to explain before pairs are searched for; no effect
#: explains as much of noise.
MIN_SINGLE_FRACTION = 0.1


#: Largest mean square with one effect more, relative to that without it, for which effects are added by
#: ordinary least squares. Next to a true one, others have 0.88 or more of autoregressive noise.
MAX_UNWEIGHTED_RATIO = 0.85

#: Probability that a residual without a cause is searched for model error.
CHANCE_PROBABILITY = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class SearchOutcome:
    """Result of a search, with the evidence for its verdict.

    Attributes
    ----------
    base : CalibrationResult
        The simulation without effects.
    screened : sequence of ScreenedEffect
        Effects screened on ``base``, the best first.
    target : Target
        Target of the last calibration.
    hypothesis : Hypothesis
    noise_floor : float
        Expected lower bound on the mean square of the residual, for any simulation.
    is_noise_floor_measured : bool
        Whether the noise floor is measured from repeated periods; otherwise it is an upper bound from the
        flexible reference model.
    residual_structure : mapping of str to float
        Maps in which the residual is not random, with their distance in standard deviations.
    verdict : Verdict
    form_alternatives : mapping of str to Alternatives
        Free forms that could take the place of each of several effects.
    timing_alternatives : mapping of str to Alternatives
        Effects of time that could take the place of each of them, with another behaviour of the input.
    cancelled : mapping of str to tuple of str
        Causes that opposed an effect, and were removed, by its name.
    """

    base: CalibrationResult
    screened: Sequence[ScreenedEffect]
    target: Target
    hypothesis: Hypothesis
    noise_floor: float
    is_noise_floor_measured: bool
    residual_structure: Mapping[str, float]
    verdict: Verdict
    form_alternatives: Mapping[str, Alternatives] = field(default_factory=dict)
    timing_alternatives: Mapping[str, Alternatives] = field(default_factory=dict)
    cancelled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def with_fit(self, fit: CalibrationResult) -> "SearchOutcome":
        """Return the outcome with another fit of the simulation of its hypothesis."""
        return replace(self, hypothesis=self.hypothesis.with_fit(fit))

    @property
    def leaves_white_noise(self) -> bool:
        """Whether a single named effect leaves white noise, so that it is probably the cause.

        Several effects may imitate such a law together.
        """
        found = self.hypothesis
        return self.verdict == Verdict.NAMED and len(found.effects) == 1 and not found.fit.noise.order


def search_with_ar_noise(
    base: CalibrationResult,
    screened: Sequence[ScreenedEffect],
    target: Target,
    run: DiagnosisRun,
) -> SearchOutcome:
    """Search for effects under the assumption that the residual is white or autoregressive noise.

    Parameters
    ----------
    base, screened : CalibrationResult, sequence of ScreenedEffect
        The simulation without effects, and the effects screened on it by ordinary least squares.
    """
    best, unweighted = best_single(base, screened), (base, screened, target)
    if best.noise.order:
        # Ordinary least squares would fit the coloured noise as well.
        run.progress("the noise is coloured: repeating with whitened residuals")
        target = whiten_target(target, best)
        base = calibrate(base.simulation, target, base.values)
        screened = screen_effects(base, target, run)
    hypothesis, found_target = stepwise_search(base, screened, target, run)
    if hypothesis.fit.noise.order:
        joint = _add_unweighted(*unweighted, run)
        if len(joint.effects) > 1:
            other, other_target = stepwise_search(base, screened, target, run, start=joint)
            if other.cost < hypothesis.cost - MIN_GAIN:
                hypothesis, found_target = other, other_target
    return make_outcome(base, screened, found_target, hypothesis)


def _add_unweighted(
    base: CalibrationResult, screened: Sequence[ScreenedEffect], target: Target, run: DiagnosisRun
) -> Hypothesis:
    """Add effects by ordinary least squares, as long as each explains a part of what the others leave.

    A noise model takes the responses to several effects for noise as long as one of them is missing.
    """
    hypothesis = Hypothesis(base, base.score, ())
    for _ in range(MAX_EFFECTS):
        fit = hypothesis.fit
        probable = [each for each in screened if each is screened[0] or each.score_gain(fit) > 0.0]
        enough = [each for each in probable if each.fit.mean_square <= MAX_UNWEIGHTED_RATIO * fit.mean_square]
        if not enough:
            break
        hypothesis = with_effect(hypothesis, enough[0])
        if not hypothesis.fit.noise.order:
            break
        screened = screen_others(hypothesis, target, run)
    return hypothesis


def search_with_model_error(base: CalibrationResult, target: Target, run: DiagnosisRun) -> SearchOutcome:
    """Search for effects under the assumption that the residual is model error."""
    run.progress("the residual is model error: repeating with unweighted residuals")
    screened: Sequence[ScreenedEffect] = ()
    hypothesis = Hypothesis(base, base.score, ())

    report = run.progress
    # The effective sample size changes the score of a fit, but not the fit: both passes share results.
    run = replace(
        run,
        parallel_map=memoised_map(run.parallel_map, StartsCalibrator, make_task_key),
        progress=lambda message, fraction=None, /: report(f"{WITH_MODEL_ERROR}{message}", fraction),
    )
    for _ in range(2):
        # Model error correlates neighbouring samples: the second pass counts them with the best effects
        # included.
        residual = target.residual(hypothesis.fit.output)
        target = replace(
            target, effective_samples=estimate_effective_samples(residual, target.fitted_segments)
        )
        base = evaluate_fit(base.simulation, target, base.values)
        if not hypothesis.effects and not _may_have_causes(base, target, run.effects):
            break
        screened = screen_effects(base, target, run)
        if not any(explained_fraction(base, each.fit, 0.0) > MIN_SINGLE_FRACTION for each in screened):
            break
        hypothesis, _ = stepwise_search(base, screened, target, run, pairs=True)
        if not hypothesis.effects:
            break
    return make_outcome(base, screened, target, hypothesis)


def make_exact_outcome(base: CalibrationResult, target: Target) -> SearchOutcome:
    """Return the outcome for a residual below the resolution: there is nothing to be searched for."""
    found = make_outcome(base, (), target, Hypothesis(base, base.score, ()))
    return replace(found, noise_floor=base.mean_square, verdict=Verdict.NOTHING)


def assess_evidence(outcome: SearchOutcome, run: DiagnosisRun) -> SearchOutcome:
    """Remove effects that fail on other samples, analyse the residual, and classify the outcome."""
    base, target, rng = outcome.base, outcome.target, run.rng
    hypothesis = remove_chance_effects(outcome.hypothesis, base, target, run.effects)
    hypothesis = validate_out_of_sample(hypothesis, base, target, rng)
    hypothesis = remove_unresolved(hypothesis, target)
    hypothesis, cancelled = resolve_cancellation(hypothesis, target, rng)
    rest = analyse_residual(hypothesis.fit, target, rng)
    if rest.is_structured or target.effective_samples is not None:
        confirmed = withdraw_effects(hypothesis, target, rng)
        if confirmed is not hypothesis:
            hypothesis, rest = confirmed, analyse_residual(confirmed.fit, target, rng)
    hypothesis = centre_values(flatten_ends(hypothesis, target), target)
    # Under model error the noise floor is unknown: the fraction refers to the whole misfit.
    explained = explained_fraction(
        choose_reference_fit(hypothesis.effects, base, target),
        hypothesis.fit,
        rest.noise_floor if target.effective_samples is None else 0.0,
    )
    verdict = classify(
        explained, bool(hypothesis.effects), rest.is_structured, target.effective_samples is not None
    )
    causes = [effect for effect in hypothesis.effects if effect.name != CORE_SHAPE]
    if causes and causes[0].is_free and verdict != Verdict.UNKNOWN:
        verdict = Verdict.FAMILY
    return replace(
        outcome,
        hypothesis=hypothesis,
        noise_floor=rest.noise_floor,
        is_noise_floor_measured=rest.is_noise_floor_measured,
        residual_structure=rest.structure,
        verdict=verdict,
        cancelled=cancelled,
    )


@dataclass(frozen=True, slots=True)
class ResidualAnalysis:
    """Noise floor and structure of a residual; see `SearchOutcome`."""

    noise_floor: float
    is_noise_floor_measured: bool
    structure: Mapping[str, float]
    is_structured: bool


def analyse_residual(fit: CalibrationResult, target: Target, rng: np.random.Generator) -> ResidualAnalysis:
    """Estimate the noise floor, and decide whether the residual of a fit has structure."""
    fitted, context = target.fitted, target.read_before_noise(fit.simulation.context)
    if target.is_matched(fit.output):
        return ResidualAnalysis(fit.mean_square, False, {}, False)
    output = fit.output[:fitted]
    residual = target.y[:fitted] - output
    explainable = explainable_variance(residual, context.u[:fitted], output, rng, context.segments)
    structure = find_residual_structure(residual, output, context, rng)
    mean_square = float(np.mean(residual[target.estimation_part[:fitted]] ** 2))
    measured_floor = noise_variance_from_periods(context.u[:fitted], target.y[:fitted], context.segments)
    return ResidualAnalysis(
        max(mean_square - explainable, 0.0) if measured_floor is None else measured_floor,
        measured_floor is not None,
        structure,
        bool(structure) or explainable > MIN_FRACTION * mean_square,
    )


def _may_have_causes(base: CalibrationResult, target: Target, effects: Sequence[Effect]) -> bool:
    """Return whether linear responses to the effects explain more of the residual than of noise.

    Responses that are fitted to the residual are left out: they explain more of it than of its surrogates.
    """
    given = [each for each in effects if not each.is_tuned]
    selection = ForwardSelection(base, target, given, MAX_EFFECTS + 1)
    return selection.compute_gain() > selection.compute_chance_gain(CHANCE_PROBABILITY)


def best_single(base: CalibrationResult, screened: Sequence[ScreenedEffect]) -> CalibrationResult:
    """Return the fit with the best single effect if its gain is sufficient, otherwise the fit without."""
    return screened[0].fit if screened and screened[0].score_gain(base) > MIN_GAIN else base


def make_outcome(
    base: CalibrationResult, screened: Sequence[ScreenedEffect], target: Target, hypothesis: Hypothesis
) -> SearchOutcome:
    """Return an outcome that has not been assessed yet."""
    return SearchOutcome(base, screened, target, hypothesis, 0.0, False, {}, Verdict.UNKNOWN)
