"""Choice of one model among the ranked models of a search.

The model with the least validation error is rarely the right one: with noise, larger models of the same
structure are better or worse by chance. The rule is a one-sided form of the one-standard-error rule (Breiman,
Friedman, Olshen & Stone, "Classification and Regression Trees", Wadsworth 1984, section 3.4.3) on paired
differences. Blocks of the validation data take the correlation of the errors into account. Models with
different warm-ups are compared over the samples that both predict. Decision 0017 compares rules.

A linear model comes before a nonlinear one. A nonlinear model is compared only if the information criterion
of its free run on all data is less than that of the linear one, or if its error on the validation data is
significantly less. After one step or one bump the validation data have no excitation: a constant is as good
there as any model, and the criterion alone decides. It is that of Schwarz with the penalty of a choice
among many terms (Chen & Chen, Biometrika 95 (2008) 759-771).

A model may be good on the validation data by chance. Its error on the estimation data is then large, or no
smaller than that of a smaller model.

The measured data are the evidence. The physics checks simulate inputs that the record does not contain, and a
system may diverge at them as its models do: a reaction that runs away, a spring that softens. The checks
therefore choose among models that the data do not distinguish. Property 1 is a requirement of the search.

The setting ``select`` can replace this rule by the paper's choice of Appendix A: the least training error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isinf, isnan, log, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.expressions.tree import Constant, Lagged
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.protocol import DynamicModel
from islands.rounding import RESOLUTION
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
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
LARGEST_RATIO = 2.0

#: Distance of the output at held inputs from its recorded range, in ranges, that is not stated.
_NEAR = 1.0

#: Drift of the output at the end of such a hold, in ranges, that is not stated.
_STILL = 0.01

#: Reasons to exclude models, in the order of the criteria.
DIVERGENCE = "validation-divergence"
INFORMATION = "information-criterion"
PROPERTY_1 = "property-1"
VALIDATION_ERROR = "validation-error"
ESTIMATION_ERROR = "estimation-error"
WORSE = "worse-than-reference"
EQUALS_ESTIMATION_ERROR = "estimation-error-of-equals"
CHECKS = "physics-checks"

#: Reasons that exclude models which are as good as the reference.
_OF_EQUALS = (EQUALS_ESTIMATION_ERROR, CHECKS)

#: Reasons that may exclude a model whose error on the validation data is the least.
_BESIDES_ERROR = (INFORMATION, PROPERTY_1, ESTIMATION_ERROR, *_OF_EQUALS)

#: Largest number of consecutive blocks of the validation data whose errors are compared between models.
BLOCKS = 20

_ONE = Constant(1.0)

#: A model of one or several outputs with its errors.
Comparable: TypeAlias = Assessment | CoupledAssessment


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Models that one criterion excludes from a recommendation.

    Attributes
    ----------
    reason : str
        ``validation-divergence``, ``information-criterion``, ``property-1``, ``validation-error``,
        ``estimation-error``, ``worse-than-reference``, ``estimation-error-of-equals`` or ``physics-checks``.
    ranks : tuple of int
    """

    reason: str
    ranks: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Recommendation:
    """Recommended model of a search.

    Attributes
    ----------
    rank : int
        Rank of the model; 1 has the least validation error.
    reasons : tuple of str
        Reasons for the choice, each a statement about measured quantities.
    reference : int or None
        Rank of the model that the others are compared with. None if models are not compared.
    excluded : tuple of Exclusion
        In the order of the criteria. The smallest of the models that none excludes is recommended.
    """

    rank: int
    reasons: tuple[str, ...]
    reference: int | None = None
    excluded: tuple[Exclusion, ...] = ()


class _Selection:
    """Models that remain under the criteria of a recommendation, and those that each of them excludes."""

    def __init__(self, count: int) -> None:
        self.left = list(range(count))
        self.excluded: list[Exclusion] = []

    def keep(self, reason: str, kept: list[int]) -> None:
        """Exclude all models but some of those that are left, unless there are none."""
        if kept and len(kept) < len(self.left):
            others = sorted({*self.left}.difference(kept))
            self.left = kept
            self.excluded.append(Exclusion(reason, tuple(at + 1 for at in others)))


def _list_terms(model: DynamicModel) -> Sequence[str]:
    """Return the terms of a model that were chosen among others."""
    return model.parameter_names if isinstance(model, Model) else ()


def is_linear(model: AnyModel) -> bool:
    """Return whether the next output of a model is linear in its inputs and its states."""
    if isinstance(model, CoupledModel):
        return all(map(is_linear, model.models))
    if isinstance(model, LatentModel):
        return not model.units
    return isinstance(model, Model) and all(
        isinstance(item.expression, Lagged | Constant) for item in model.regressors
    )


def measure_size(model: DynamicModel) -> float:
    """Return the number of terms by which models are compared; a constant is half a term.

    The zero of a unit decides whether a law has a constant: in another unit, the law with one more term is
    still larger, and without an offset the law without a constant is smaller.
    """
    has_constant = isinstance(model, Model) and any(item.expression == _ONE for item in model.regressors)
    has_level = isinstance(model, LatentModel) and not model.units
    return model.free_size - 0.5 * (has_constant or has_level)


def recommend(
    sizes: Sequence[float], assessments: Sequence[Assessment], hysteresis: bool, unit: str = ""
) -> Recommendation:
    """Choose the linear model, or the smallest nonlinear model that is as good as the best one.

    Candidates are the models whose free run on the validation data is bounded. Of the linear ones, that
    with the least information criterion on all data is recommended, unless nonlinear ones are better by
    their criterion or, significantly, on the validation data. Only these are compared then and, if the
    search constrains models of hysteresis, of them those that have Property 1. Those whose error on the
    validation data exceeds twice the least are excluded, and of the others those whose free-run error on
    the estimation data exceeds twice the least of them. Of the rest, the one with the least RMSE is the
    reference. A model is as good as the reference if its RMSE exceeds that of the reference by at most 1 %,
    or is below 1e-6 of the output range, or if it exceeds that of the reference by at most 20 % and the
    mean squared errors differ by at most three standard errors. The standard error is that of the mean
    difference over blocks of the validation data. A model is also as good if its RMSE on the estimation
    data exceeds that of the reference by at most 1 %, and that on the validation data by at most 50 %. Of
    these models, those whose free-run error on the estimation data exceeds 1.5 times the least of them are
    excluded, and of the rest those that diverge in holds or excursions. A criterion that no model meets
    excludes none.

    Parameters
    ----------
    sizes : sequence of float
        Numbers of terms as of `measure_size`, in the order of the ranks.
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
    selection = _Selection(len(assessments))
    selection.keep(DIVERGENCE, bounded)
    terms = {name for entry in assessments for name in _list_terms(entry.model)}
    selection.keep(INFORMATION, _keep_informative(bounded, sizes, assessments, len(terms)))
    if hysteresis:
        selection.keep(PROPERTY_1, [at for at in bounded if assessments[at].physics.property_1])
    selection.keep(
        VALIDATION_ERROR, _pass_over(selection.left, assessments, LARGEST_RATIO, _measure_validation)
    )
    selection.keep(ESTIMATION_ERROR, _pass_over(selection.left, assessments, LARGEST_RATIO))
    reference = min(selection.left, key=lambda at: (assessments[at].validation_error, at))
    best = assessments[reference]
    selection.keep(WORSE, [at for at in selection.left if _is_equal(assessments[at], best)])
    selection.keep(EQUALS_ESTIMATION_ERROR, _pass_over(selection.left, assessments, LARGEST_ESTIMATION_RATIO))
    selection.keep(CHECKS, [at for at in selection.left if is_sound(assessments[at].physics, hysteresis)])
    chosen = min(selection.left, key=lambda at: (sizes[at], at))
    found = Recommendation(chosen + 1, (), reference + 1, tuple(selection.excluded))
    reasons = (
        _describe_choice(found, sizes, assessments, unit),
        _describe_physics(found, assessments, hysteresis, unit),
    )
    return replace(found, reasons=tuple(filter(None, reasons)))


def _keep_informative(
    places: Sequence[int], sizes: Sequence[float], assessments: Sequence[Comparable], terms: int
) -> list[int]:
    """Return the nonlinear models that are better than the best linear one, or the latter alone.

    Of linear models, the one with the least criterion is the best. A nonlinear one is better if its criterion
    is less, or if the validation data show a significant difference and more than a constant output.

    Parameters
    ----------
    places : sequence of int
        Models with a bounded free run.
    sizes, assessments
        Of all models.
    terms : int
        Number of terms among which nonlinear models choose.
    """
    linear = [at for at in places if is_linear(assessments[at].model)]
    if not linear:
        return list(places)
    choice = 2.0 * log(max(1, terms))

    def gain(at: int, other: int) -> float:
        """Return by how much the criterion of a model is smaller than that of another one."""
        errors = [assessments[each].mean_square for each in (at, other)]
        samples = assessments[at if errors[0] < errors[1] else other].effective_samples
        penalties = [
            sizes[each] * (log(samples) + choice * (not is_linear(assessments[each].model)))
            for each in (at, other)
        ]
        return samples * (log(errors[1]) - log(errors[0])) + penalties[1] - penalties[0]

    best = linear[0]
    for at in linear[1:]:
        best = at if gain(at, best) > 0.0 else best

    def is_better(at: int) -> bool:
        one, other = assessments[at], assessments[best]
        shows_motion = one.unexplained * (1.0 + LARGEST_EXCESS) ** 2 < 1.0
        return gain(at, best) > 0.0 or (shows_motion and not _is_as_good(other, one))

    return [at for at in places if at not in linear and is_better(at)] or [best]


def recommend_joint(
    sizes: Sequence[float], assessments: Sequence[CoupledAssessment], terms: int
) -> CoupledAssessment:
    """Return the linear model of several outputs, or the smallest nonlinear one that is as good as the best.

    The rule is that of `recommend`, on the common free runs. If all of them diverge, it is the first model.

    Parameters
    ----------
    sizes : sequence of float
        Numbers of parameters that have an effect.
    assessments : sequence of CoupledAssessment
    terms : int
        Number of terms among which equations choose.
    """
    bounded = [at for at, entry in enumerate(assessments) if isfinite(entry.mean_square)]
    if not bounded:
        return assessments[0]
    kept = _keep_informative(bounded, sizes, assessments, terms)
    best = min(kept, key=lambda at: assessments[at].validation_error)
    equal = [at for at in kept if _is_as_good(assessments[at], assessments[best])]
    return assessments[min(equal, key=lambda at: sizes[at], default=best)]


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
    checks = _describe_passed(hysteresis, entry.final_physics)
    return Recommendation(chosen + 1, tuple(filter(None, (reason, checks))))


def list_rivals(
    found: Recommendation, sizes: Sequence[float], assessments: Sequence[Assessment]
) -> tuple[Exclusion, ...]:
    """Return the excluded models that would be preferred without the reason that excludes them.

    They have a smaller error than the reference, or are as good as it and smaller than the recommended model.
    """
    if found.reference is None:
        return ()
    best, size = assessments[found.reference - 1], sizes[found.rank - 1]

    def is_rival(rank: int) -> bool:
        entry = assessments[rank - 1]
        is_better = entry.validation_error < best.validation_error
        return is_better or (sizes[rank - 1] < size and _is_equal(entry, best))

    rivals = (replace(each, ranks=tuple(filter(is_rival, each.ranks))) for each in found.excluded)
    return tuple(each for each in rivals if each.ranks and each.reason in _BESIDES_ERROR)


def describe_exclusion(exclusion: Exclusion, assessments: Sequence[Assessment]) -> str:
    """State what excludes some models, to be read after their names."""
    if exclusion.reason == PROPERTY_1:
        return "without Property 1"
    if exclusion.reason == INFORMATION:
        return "not better by the information criterion on all data"
    if exclusion.reason == CHECKS:
        return _describe_divergence([assessments[rank - 1].physics for rank in exclusion.ranks])
    of_equals = exclusion.reason in _OF_EQUALS
    ratio, least = (LARGEST_ESTIMATION_RATIO, " of these") if of_equals else (LARGEST_RATIO, "")
    return f"with more than {ratio:g} times the least error{least} on the estimation data"


def _describe_divergence(physics: Sequence[PhysicsChecks]) -> str:
    """State at which holds and excursions some models diverge."""
    levels = sorted({abs(hold.level) for each in physics for hold in each.holds if not hold.bounded})
    names = dict.fromkeys(test.name for each in physics for test in each.excursions if not test.bounded)
    held = f"inputs held at {' and '.join(f'{level:g}' for level in levels)} times their recorded amplitude"
    return f"with a divergence at {' and at '.join([*([held] if levels else []), *names])}"


def is_sound(physics: PhysicsChecks, hysteresis: bool) -> bool:
    """Return whether holds and excursions are bounded and, if required, Property 1 holds."""
    bounded = all(hold.bounded for hold in physics.holds) and all(
        excursion.bounded for excursion in physics.excursions
    )
    return bounded and (physics.property_1 or not hysteresis)


def _is_equal(entry: Assessment, reference: Assessment) -> bool:
    """Return whether a model is as good as the reference."""
    return _is_as_good(entry, reference) or _is_as_good_in_estimation(entry, reference)


def _is_as_good(entry: Comparable, reference: Comparable) -> bool:
    """Return whether the error on the validation data does not differ significantly from the reference."""
    blocks = compare_blocks(entry.squared_errors, reference.squared_errors)
    if not blocks.size:
        return False
    # The square of a large error may be infinite.
    with np.errstate(invalid="ignore", over="ignore"):
        error, smallest = np.sqrt(blocks.mean(axis=1))
        if error <= max(RESOLUTION, (1.0 + NEGLIGIBLE_EXCESS) * smallest):
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
    return RESOLUTION if isnan(found.fit_percent) else max(RESOLUTION, 1.0 - found.fit_percent / 100.0)


def _measure_validation(entry: Assessment) -> float:
    """Return the free-run error on the predicted validation data relative to the output range."""
    with np.errstate(invalid="ignore", over="ignore"):
        return max(RESOLUTION, float(np.sqrt(np.nanmean(entry.squared_errors))))


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
    found: Recommendation, sizes: Sequence[float], assessments: Sequence[Assessment], unit: str
) -> str:
    """State the criterion, the errors, and the excluded models that the criterion would prefer."""
    chosen, best = (assessments[rank - 1] for rank in (found.rank, found.reference or found.rank))
    error, least = (_write_error(entry.validation_error, unit) for entry in (chosen, best))
    if is_linear(chosen.model) and any(not is_linear(each.model) for each in assessments):
        return (
            "linear: no nonlinear model is better by the information criterion of the free run on all data, "
            f"or significantly better on the validation data; RMSE on the validation data {error}"
        )
    rivals = list_rivals(found, sizes, assessments)
    equals, others = (
        [
            f"{_write_models(each.ranks, assessments, unit)} {describe_exclusion(each, assessments)}"
            for each in rivals
            if (each.reason in _OF_EQUALS) == of_equals
        ]
        for of_equals in (True, False)
    )
    exception = f", except {' and '.join(equals)}" if equals else ""
    scope = " of the models that are not left out" if others else ""
    end = f"; left out: {' and '.join(others)}" if others else ""
    data = f"free-run error on the validation data{scope}"
    if chosen is best:
        return f"least {data}, RMSE {error}; no smaller model is as good{exception}{end}"
    worse = {rank for each in found.excluded if each.reason not in _OF_EQUALS for rank in each.ranks}
    equal = [each for rank, each in enumerate(assessments, start=1) if rank not in worse]
    if _is_as_good(chosen, best):
        count = sum(_is_as_good(each, best) for each in equal)
        return (
            f"smallest of {count} models whose free-run errors on the validation data do not differ "
            f"significantly from the least{scope}{exception}: RMSE {error}, least {least}{end}"
        )
    return (
        f"smallest of {len(equal)} models as good as that with the least {data}{exception}: its error on the "
        f"estimation data is no larger, that on the validation data is RMSE {error}, least {least}{end}"
    )


def _write_error(error: float, unit: str) -> str:
    return f"{error:.4g} {unit}".rstrip()


def _write_models(ranks: Sequence[int], assessments: Sequence[Assessment], unit: str) -> str:
    """Return the number of some models, with their errors on the validation data."""
    errors = [assessments[rank - 1].validation_error for rank in ranks]
    limits = dict.fromkeys(f"{error:.4g}" for error in (min(errors), max(errors)))
    return f"{len(ranks)} (RMSE {' to '.join(limits)}{unit and f' {unit}'})"


def _describe_physics(
    found: Recommendation, assessments: Sequence[Assessment], hysteresis: bool, unit: str
) -> str:
    """State the levels at which the model is bounded, or which models pass the checks that it fails.

    Empty if the model was not checked.
    """
    entry = assessments[found.rank - 1]
    if entry.physics.not_computed:
        return ""
    if is_sound(entry.physics, hysteresis):
        return _describe_passed(hysteresis, entry.final_physics)
    passing = [
        at
        for at, each in enumerate(assessments, start=1)
        if each.outcomes["validation"]["free_run"] and is_sound(each.physics, hysteresis)
    ]
    checks = _list_checks("bounded", max(map(abs, LEVELS)), "", hysteresis and not passing)
    if not passing:
        return f"no model passes the physics checks ({checks})"
    return (
        f"the data contradict the physics checks ({checks}): the models that pass them have larger errors on "
        f"the validation or the estimation data, {_write_models(passing, assessments, unit)}"
    )


def _describe_passed(hysteresis: bool, physics: PhysicsChecks) -> str:
    """State the levels at which a model that passes the physics checks is bounded; empty if not checked."""
    if physics.not_computed:
        return ""
    beyond = [abs(each.level) for each in physics.extremes if not each.plausible]
    held = max(
        (abs(each.level) for each in physics.extremes if abs(each.level) < min(beyond, default=inf)),
        default=0,
    )
    held = max(held, *map(abs, LEVELS))
    moves = _describe_motion(held, physics)
    state, remark = ("no divergence", f" (where {moves})") if moves else ("bounded", "")
    return _list_checks(state, held, remark, hysteresis)


def _list_checks(state: str, held: float, remark: str, hysteresis: bool) -> str:
    factors = {
        kind: " and ".join(f"{factor:g}" for named, factor in EXCURSIONS if named == kind)
        for kind in ("amplitude", "rate")
    }
    return (
        f"{state} at inputs held at up to {held:g} times their recorded amplitude about the midpoint{remark}"
        f", at {factors['amplitude']} times the amplitude and at {factors['rate']} times the rate"
        f"{', and Property 1 holds' if hysteresis else ''}"
    )


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
