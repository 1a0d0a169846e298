"""Evidence: the causes that explain a record best, what they leave, and whether that may be called a name.

It is gathered by the noise: what is left is taken for an autoregression. A simulation whose form is wrong
leaves more than that, and whatever whitens it would win: then it is gathered by misfit, each sample counting
for as much as it says that its neighbours have not said.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.discrepancy.calibration.levenberg_marquardt import (
    CalibrationResult,
    Target,
    calibrate,
    evaluate_fit,
)
from islands.discrepancy.calibration.noise_model import effective_samples
from islands.discrepancy.inference.hypothesis import Hypothesis
from islands.discrepancy.inference.noise_floor import explainable_variance, noise_variance_from_periods
from islands.discrepancy.inference.residual_structure import describe_remainder
from islands.discrepancy.inference.screening import ScreenedEffect, is_same_fit, screen_effects
from islands.discrepancy.inference.stepwise_search import LEAST, stepwise_search
from islands.discrepancy.inference.verdict import (
    Verdict,
    classify,
    explained_fraction,
    reference_variance,
    validate_out_of_sample,
)
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.parallel import ParallelMap, memoised_map
from islands.evolution.progress import ProgressCallback

#: Share of the misfit that a single effect has to explain for pairs to be looked for: of noise none does.
WORTHWHILE = 0.1

#: Part of a residual's mean square that a flexible reference would not explain by chance.
NOTICEABLE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class SearchOutcome:
    """What was found, and against what.

    Attributes
    ----------
    base : CalibrationResult
        The simulation alone.
    screened : tuple of ScreenedEffect
        Its ladder.
    target : Target
        What all was held against.
    hypothesis : Hypothesis
    noise_floor : float
        Mean square that no simulation is expected to be below.
    is_noise_floor_measured : bool
        It is known from periods that repeat; else it is an upper bound, by what a flexible fit foretells.
    residual_structure : mapping of str to float
        Maps in which what is left is no chance.
    verdict : Verdict
    """

    base: CalibrationResult
    screened: Sequence[ScreenedEffect]
    target: Target
    hypothesis: Hypothesis
    noise_floor: float
    is_noise_floor_measured: bool
    residual_structure: Mapping[str, float]
    verdict: Verdict


def search_with_ar_noise(
    base: CalibrationResult,
    rungs: Sequence[ScreenedEffect],
    target: Target,
    effects: Sequence[Effect],
    progress: ProgressCallback,
    spread: ParallelMap,
) -> SearchOutcome:
    """Look for what explains a record, what is left being noise that may remember.

    Parameters
    ----------
    base, rungs : CalibrationResult, sequence of ScreenedEffect
        The simulation alone, and its ladder by plain least squares.
    """
    memory = best_single(base, rungs).noise
    if memory.order:
        # Once more, with what the noise remembers taken out: plain least squares would fit that as well.
        progress("the noise remembers: once more with that taken out")
        target = replace(target, noise=memory)
        base = calibrate(base.simulation, target, base.values)
        rungs = screen_effects(base, target, effects, spread)
    found, target = stepwise_search(base, rungs, target, effects, progress, spread)
    return _unjudged(base, rungs, target, found)


def search_with_model_error(
    base: CalibrationResult,
    target: Target,
    effects: Sequence[Effect],
    progress: ProgressCallback,
    spread: ParallelMap,
) -> SearchOutcome:
    """Look for what explains a record's misfit, whatever is left being of the simulation's form."""
    progress("the form is wrong: once more by the misfit alone")
    rungs: Sequence[ScreenedEffect] = ()
    found = Hypothesis(base, base.score, ())
    spread = memoised_map(
        spread, is_same_fit
    )  # how many samples count changes what a fit is worth, and not the fit
    for _ in range(2):
        # Neighbours say less that is new the more misfit there is: counted anew with the best causes in.
        target = replace(target, effective_samples=effective_samples(target.residual(found.fit.output)))
        base = evaluate_fit(base.simulation, target, base.values)
        rungs = screen_effects(base, target, effects, spread)
        if not any(explained_fraction(base, rung.fit, 0.0) > WORTHWHILE for rung in rungs):
            break
        found, _ = stepwise_search(base, rungs, target, effects, progress, spread, pairs=True)
        if not found.effects:
            break
    return _unjudged(base, rungs, target, found)


def assess_evidence(evidence: SearchOutcome, fitted: int, rng: np.random.Generator) -> SearchOutcome:
    """Drop what does not foretell samples that were not fitted, look at what is left, and decide."""
    base, target = evidence.base, evidence.target
    found = validate_out_of_sample(evidence.hypothesis, base, target, fitted, rng)
    context, output = found.fit.simulation.context, found.fit.output[:fitted]
    residual = target.y[:fitted] - output
    left = explainable_variance(residual, context.u[:fitted], output, rng)
    maps = describe_remainder(residual, output, context, rng)
    mean_square = float(np.mean(residual**2))
    repeated = noise_variance_from_periods(context.u[:fitted], target.y[:fitted])
    floor = max(mean_square - left, 0.0) if repeated is None else repeated
    remains = bool(maps) or left > NOTICEABLE * mean_square
    # By misfit nobody knows which part of it is noise: half of all of it has to be explained.
    explained_share = explained_fraction(
        reference_variance(found, base, target), found.fit, floor if target.effective_samples is None else 0.0
    )
    verdict = classify(explained_share, bool(found.effects), remains, target.effective_samples is not None)
    return replace(
        evidence,
        hypothesis=found,
        noise_floor=floor,
        is_noise_floor_measured=repeated is not None,
        residual_structure=maps,
        verdict=verdict,
    )


def best_single(base: CalibrationResult, rungs: Sequence[ScreenedEffect]) -> CalibrationResult:
    """Return the first rung's simulation where it pays, else the one without."""
    return rungs[0].fit if rungs and rungs[0].score_gain(base) > LEAST else base


def _unjudged(
    base: CalibrationResult, rungs: Sequence[ScreenedEffect], target: Target, found: Hypothesis
) -> SearchOutcome:
    return SearchOutcome(base, rungs, target, found, 0.0, False, {}, Verdict.UNKNOWN)
