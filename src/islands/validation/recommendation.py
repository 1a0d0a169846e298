"""Choice of one model among the ranked models of a search.

The model with the least validation error is rarely the right one: with noise, larger models of the same
structure are better or worse by chance. The rule is a one-sided form of the one-standard-error rule (Breiman,
Friedman, Olshen & Stone, "Classification and Regression Trees", Wadsworth 1984, section 3.4.3) on paired
differences. Blocks of the validation data take the correlation of the errors into account. Models with
different warm-ups are compared over the samples that both predict. Decision 0017 compares rules.

A model may be good on the validation data by chance. Its error on the estimation data is then large, or no
smaller than that of a smaller model.

The setting ``select`` can replace this rule by the paper's choice of Appendix A: the least training error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isinf, isnan, sqrt

import numpy as np
from numpy.typing import NDArray

from islands.validation.assessment import Assessment
from islands.validation.ensemble import LARGEST_ESTIMATION_RATIO
from islands.validation.physics import EXCURSIONS, LEVELS, PhysicsChecks

#: Standard errors by which a mean squared error may exceed the least, which is a minimum over many models.
STANDARD_ERRORS = 3.0

#: Largest excess of an RMSE over the least, as a fraction, however uncertain the difference is.
LARGEST_EXCESS = 0.2

#: Excess of an RMSE over the least, as a fraction, that never justifies another term.
NEGLIGIBLE_EXCESS = 0.01

#: Excess of an RMSE over the least, as a fraction, of a model that is as good on the estimation data.
_EXCESS_BY_CHANCE = 0.5

#: Largest error on the validation data, and then on the estimation data, relative to the least, of a model
#: that is compared.
_LARGEST_RATIO = 2.0

#: RMSE as a fraction of the output range below which errors count as equal.
ROUNDING = 1e-6

#: Distance of the output at held inputs from its recorded range, in ranges, that is not stated.
_NEAR = 1.0

#: Drift of the output at the end of such a hold, in ranges, that is not stated.
_STILL = 0.01

#: Largest number of consecutive blocks of the validation data whose errors are compared between models.
BLOCKS = 20


@dataclass(frozen=True, slots=True)
class Recommendation:
    """Recommended model of a search.

    Attributes
    ----------
    rank : int
        Rank of the model; 1 has the least validation error.
    reasons : tuple of str
        Reasons for the choice, each a statement about measured quantities.
    """

    rank: int
    reasons: tuple[str, ...]


def recommend(
    sizes: Sequence[int], assessments: Sequence[Assessment], hysteresis: bool, unit: str = ""
) -> Recommendation:
    """Choose the smallest model that is as good as the best one.

    Candidates are the models whose free run on the validation data is bounded and which pass the physics
    checks: holds and excursions stay bounded and, if the search constrains models of hysteresis, Property 1
    holds. Those whose error on the validation data exceeds twice the least are left out, and of the others
    those whose free-run error on the estimation data exceeds twice the least of them. Of the rest, the one
    with the least RMSE is the reference. A model is as good as the reference if its RMSE exceeds that of the
    reference by at most 1 %, or is below 1e-6 of the output range, or if it exceeds that of the reference by
    at most 20 % and the mean squared errors differ by at most three standard errors. The standard error is
    that of the mean difference over blocks of the validation data. A model is also as good if its RMSE on the
    estimation data exceeds that of the reference by at most 1 %, and that on the validation data by at most
    50 %. Of these models, those whose free-run error on the estimation data exceeds 1.5 times the least of
    them are passed over.

    Parameters
    ----------
    sizes : sequence of int
        Numbers of terms, in the order of the ranks.
    assessments : sequence of Assessment
        Assessments on the same estimation data and validation data, best first.
    hysteresis : bool
        Whether models need Property 1.
    unit : str
        Unit of the output, for the reasons.
    """
    bounded = [at for at, entry in enumerate(assessments) if entry.outcomes["validation"]["free_run"]]
    if not bounded:
        return Recommendation(
            1, ("the free run of every model diverges; this one has the least one-step-ahead error",)
        )
    sound = [at for at in bounded if is_sound(assessments[at].physics, hysteresis)]
    candidates = sound or bounded
    best = min(candidates, key=lambda at: (assessments[at].validation_error, at))
    comparable = _pass_over(candidates, assessments, _LARGEST_RATIO, _measure_validation)
    close = _pass_over(comparable, assessments, _LARGEST_RATIO)
    lucky = best not in close
    best = min(close, key=lambda at: (assessments[at].validation_error, at))
    equal = [
        at
        for at in close
        if _is_as_good(assessments[at], assessments[best])
        or _is_as_good_in_estimation(assessments[at], assessments[best])
    ]
    kept = _pass_over(equal, assessments, LARGEST_ESTIMATION_RATIO)
    chosen = min(kept, key=lambda at: (sizes[at], at))
    reasons = (
        _describe_choice(chosen, best, len(equal), len(kept), assessments, unit) + _describe_luck(lucky),
        _describe_physics(bool(sound), hysteresis, assessments[chosen].final_physics),
    )
    return Recommendation(chosen + 1, tuple(filter(None, reasons)))


def recommend_fittest(
    assessments: Sequence[Assessment], mode: str, hysteresis: bool, unit: str = ""
) -> Recommendation:
    """Choose the model with the least error on the estimation data, as Appendix A of the paper does.

    The validation data have no influence: the free run of the model on them may diverge.

    Parameters
    ----------
    assessments : sequence of Assessment
        Assessments in the order of the ranks.
    mode : str
        An entry of ``MODES``: the simulation whose error the search minimised.
    hysteresis : bool
        Whether models need Property 1.
    unit : str
        Unit of the output, for the reason.
    """
    errors = [entry.metrics["estimation"][mode].rmse for entry in assessments]
    chosen = min(range(len(errors)), key=lambda at: (inf if isnan(errors[at]) else errors[at], at))
    size = f"{errors[chosen]:.4g} {unit}".rstrip()
    reason = f"least error of the search on the estimation data ({mode.replace('_', ' ')}), RMSE {size}"
    entry = assessments[chosen]
    if not is_sound(entry.physics, hysteresis):
        return Recommendation(chosen + 1, (reason,))
    checks = _describe_physics(True, hysteresis, entry.final_physics)
    return Recommendation(chosen + 1, tuple(filter(None, (reason, checks))))


def is_sound(physics: PhysicsChecks, hysteresis: bool) -> bool:
    """Return whether holds and excursions are bounded and, if required, Property 1 holds."""
    bounded = all(hold.bounded for hold in physics.holds) and all(
        excursion.bounded for excursion in physics.excursions
    )
    return bounded and (physics.property_1 or not hysteresis)


def _is_as_good(entry: Assessment, reference: Assessment) -> bool:
    """Return whether the error on the validation data does not differ significantly from the reference."""
    blocks = compare_blocks(entry.squared_errors, reference.squared_errors)
    if not blocks.size:
        return False
    # The square of a large error may be infinite.
    with np.errstate(invalid="ignore", over="ignore"):
        error, smallest = np.sqrt(blocks.mean(axis=1))
        if error <= max(ROUNDING, (1.0 + NEGLIGIBLE_EXCESS) * smallest):
            return True
        excess = blocks[0] - blocks[1]
        uncertainty = STANDARD_ERRORS * excess.std(ddof=1) / sqrt(len(excess)) if len(excess) > 1 else 0.0
        return bool(error <= (1.0 + LARGEST_EXCESS) * smallest and excess.mean() <= uncertainty)


def _is_as_good_in_estimation(entry: Assessment, reference: Assessment) -> bool:
    """Return whether the error on the estimation data is no larger, and that on the validation data similar.

    The reference may have the least error on the validation data by chance.
    """
    error, smallest = _measure_estimation(entry), _measure_estimation(reference)
    if isinf(error) or error > (1.0 + NEGLIGIBLE_EXCESS) * smallest:
        return False
    return entry.validation_error <= (1.0 + _EXCESS_BY_CHANCE) * reference.validation_error


def _pass_over(
    places: Sequence[int],
    assessments: Sequence[Assessment],
    ratio: float,
    measure: Callable[[Assessment], float] | None = None,
) -> list[int]:
    """Return the models whose error is at most a multiple of the least; by default on the estimation data."""
    errors = {at: (measure or _measure_estimation)(assessments[at]) for at in places}
    limit = ratio * min(errors.values())
    return [at for at, error in errors.items() if error <= limit]


def _measure_estimation(entry: Assessment) -> float:
    """Return the free-run error on the estimation data relative to the standard deviation of the output.

    Infinite after a divergence. Errors up to rounding are equal, and those of a constant output.
    """
    found = entry.metrics["estimation"]["free_run"]
    if isnan(found.rmse):
        return inf
    return ROUNDING if isnan(found.fit_percent) else max(ROUNDING, 1.0 - found.fit_percent / 100.0)


def _measure_validation(entry: Assessment) -> float:
    """Return the free-run error on the predicted validation data relative to the output range."""
    with np.errstate(invalid="ignore", over="ignore"):
        return max(ROUNDING, float(np.sqrt(np.nanmean(entry.squared_errors))))


def compare_blocks(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean squared errors of two models on blocks of the samples that both predict.

    Parameters
    ----------
    one, other : ndarray, shape (samples,)
        `Assessment.squared_errors` on the same validation data. The numbers of samples differ if the samples
        are means of different numbers of samples; samples at the same part of the data are then compared.

    Returns
    -------
    ndarray, shape (2, blocks)
        At most `BLOCKS` consecutive blocks; none if no sample is predicted by both.
    """
    common = [_select_common(one, other), _select_common(other, one)]
    count = min(BLOCKS, *map(len, common))
    blocks = [np.array_split(errors, count) if count else [] for errors in common]
    return np.array([[np.add.reduce(block) / len(block) for block in each] for each in blocks])


def _select_common(errors: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the errors at the samples that both models predict."""
    if not (len(errors) and len(others)):
        return np.empty(0)
    at = (2 * np.arange(len(errors)) + 1) * len(others) // (2 * len(errors))  # middle of the sample
    return errors[~(np.isnan(errors) | np.isnan(others[at]))]


def _describe_choice(
    chosen: int, best: int, equal: int, kept: int, assessments: Sequence[Assessment], unit: str
) -> str:
    """State the choice among a number of equal models, of which some are kept for the estimation data."""
    error, least = (f"{assessments[at].validation_error:.4g} {unit}".rstrip() for at in (chosen, best))
    if chosen == best:
        both = " on both parts of the data" if kept < equal else ""
        return f"least free-run error on the validation data, RMSE {error}; no smaller model is as good{both}"
    exception = (
        f", without {equal - kept} with more than {LARGEST_ESTIMATION_RATIO:g} times the least error of these"
        " on the estimation data"
    )
    exception = exception if kept < equal else ""
    if _is_as_good(assessments[chosen], assessments[best]):
        return (
            f"smallest of {equal} models whose free-run errors on the validation data do not differ "
            f"significantly from the least{exception}: RMSE {error}, least {least}"
        )
    return (
        f"smallest of {equal} models as good as that with the least free-run error on the validation data"
        f"{exception}: its error on the estimation data is no larger, that on the validation data is RMSE "
        f"{error}, least {least}"
    )


def _describe_luck(lucky: bool) -> str:
    """State whether the model with the least validation error of all is left out."""
    if not lucky:
        return ""
    condition = f"more than {_LARGEST_RATIO:g} times the least error on the estimation data"
    return f"; models with {condition} are left out"


def _describe_physics(sound: bool, hysteresis: bool, physics: PhysicsChecks) -> str:
    """State the levels at which the model is bounded, or those of the checks that no model passes.

    Empty if the model was not checked.
    """
    if physics.not_computed:
        return ""
    beyond = [abs(each.level) for each in physics.extremes if not each.plausible]
    held = max(
        (abs(each.level) for each in physics.extremes if abs(each.level) < min(beyond, default=inf)),
        default=0,
    )
    held = max(held, *map(abs, LEVELS)) if sound else max(map(abs, LEVELS))
    factors = {
        kind: " and ".join(f"{factor:g}" for named, factor in EXCURSIONS if named == kind)
        for kind in ("amplitude", "rate")
    }
    state, remark = "bounded", ""
    if sound and (moves := _describe_motion(held, physics)):
        state, remark = "no divergence", f" (where {moves})"
    checks = (
        f"{state} at inputs held at up to {held:g} times their recorded amplitude about the midpoint{remark}"
        f", at {factors['amplitude']} times the amplitude and at {factors['rate']} times the rate"
    )
    checks += ", and Property 1 holds" if hysteresis else ""
    return checks if sound else f"no model passes the physics checks ({checks})"


def _describe_motion(held: float, physics: PhysicsChecks) -> str:
    """State how the output leaves its recorded range at held inputs; empty if it rests in or near it.

    A hold cannot show that an output which moves on, as that of an integrator, is bounded.
    """
    tests = [each for each in physics.extremes if abs(each.level) <= held]
    ranges, drift = (
        max(values, default=0.0) for values in ([t.ranges for t in tests], [t.drift for t in tests])
    )
    if ranges <= _NEAR and drift <= _STILL:
        return ""
    leaves = f"leaves its recorded range by up to {ranges:.3g} ranges" if ranges > 0.0 else ""
    moves = "is still moving at the end" if drift > _STILL else ""
    return f"the output {' and '.join(filter(None, (leaves, moves)))}"
