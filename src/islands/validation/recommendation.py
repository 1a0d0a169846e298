"""Choice of one model among the ranked models of a search, by their evidence.

A difference of ten is very strong evidence (Kass & Raftery, J. American Statistical Association 90 (1995)
773-795). Models that differ by less are equal: a linear one comes first, then the smallest. If the user
prefers accuracy, the one with the most evidence comes first. See `islands.validation.evidence`.

The measured data are the evidence. The physics checks simulate inputs that the record does not contain, and a
system may diverge at them as its models do: a reaction that runs away, a spring that softens. The checks
therefore choose among models that the data do not distinguish. Property 1 is a requirement of the search.

The setting ``select`` can replace this rule by the paper's choice of Appendix A: the least training error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan
from typing import TypeAlias

from islands.models.narx import Model
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.evidence import ErrorNoise, count_terms, is_linear, is_static, measure_lack
from islands.validation.physics import EXCURSIONS, LEVELS, PhysicsChecks

#: Difference of the evidence of two models that do not count as equal.
DECISIVE = 10.0

#: Distance of the output at held inputs from its recorded range, in ranges, that is not stated.
_NEAR = 1.0

#: Drift of the output at the end of such a hold, in ranges, that is not stated.
_STILL = 0.01

#: Reasons to exclude models, in the order of the criteria.
DIVERGENCE = "validation-divergence"
PROPERTY_1 = "property-1"
EVIDENCE = "evidence"
CHECKS = "physics-checks"

#: A model of one or several outputs with its errors.
Comparable: TypeAlias = Assessment | CoupledAssessment


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Models that one criterion excludes from a recommendation.

    Attributes
    ----------
    reason : str
        ``validation-divergence``, ``property-1``, ``evidence`` or ``physics-checks``.
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


def recommend(
    sizes: Sequence[float],
    assessments: Sequence[Assessment],
    hysteresis: bool,
    unit: str = "",
    accurate: bool = False,
) -> Recommendation:
    """Choose the simplest of the models with the most evidence.

    Candidates are the models whose free run on the validation data is bounded and, if the search constrains
    models of hysteresis, of them those that have Property 1. The one with the most evidence is the reference.
    Of the models with as much evidence, those that diverge in holds or excursions are excluded, and the first
    linear one of the rest is recommended, or a static one, or the smallest. A criterion that no model meets
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
    accurate : bool
        Whether the model with the most evidence is recommended, of those that are left.
    """
    bounded = [at for at, entry in enumerate(assessments) if entry.outcomes["validation"]["free_run"]]
    if not bounded:
        return Recommendation(
            1, ("the free run of every model diverges; this one has the least one-step-ahead error",)
        )
    selection = _Selection(len(assessments))
    selection.keep(DIVERGENCE, bounded)
    if hysteresis:
        selection.keep(PROPERTY_1, [at for at in bounded if assessments[at].physics.property_1])
    # A divergence that the record does not show needs a smaller error than that of every model without one.
    is_bounded = [is_sound(assessments[at].physics, hysteresis) for at in selection.left]
    first = is_bounded.index(True) if any(is_bounded) else len(is_bounded)
    selection.keep(
        CHECKS, [at for place, at in enumerate(selection.left) if is_bounded[place] or place < first]
    )
    terms = count_terms([entry.model for entry in assessments])
    lack = _measure_lack(selection.left, sizes, assessments, terms)
    reference = min(selection.left, key=lambda at: (lack[at], at))
    limit = lack[reference] + DECISIVE
    selection.keep(EVIDENCE, [at for at in selection.left if lack[at] <= limit])
    selection.keep(CHECKS, [at for at in selection.left if is_sound(assessments[at].physics, hysteresis)])
    chosen = (
        min(selection.left, key=lambda at: (lack[at], at))
        if accurate
        else _take_simplest(selection.left, sizes, assessments, lack)
    )
    found = Recommendation(chosen + 1, (), reference + 1, tuple(selection.excluded))
    model = assessments[chosen].model
    reasons = (
        f"static: {model.output_name} depends on the inputs of the same sample only"
        if is_static(model)
        else "",
        _describe_choice(found, sizes, assessments, unit, accurate),
        _describe_physics(found, assessments, hysteresis, unit),
    )
    return replace(found, reasons=tuple(filter(None, reasons)))


def recommend_joint(assessments: Sequence[CoupledAssessment], terms: int) -> CoupledAssessment:
    """Return the simplest of the models of several outputs with the most evidence.

    The rule is that of `recommend`, on the common free runs. If all of them diverge, it is the first model.

    Parameters
    ----------
    assessments : sequence of CoupledAssessment
    terms : int
        Number of terms among which equations choose.
    """
    bounded = [at for at, entry in enumerate(assessments) if isfinite(entry.mean_square)]
    if not bounded:
        return assessments[0]
    sizes = [entry.size for entry in assessments]
    lack = _measure_lack(bounded, sizes, assessments, terms)
    limit = min(lack.values()) + DECISIVE
    equal = [at for at in bounded if lack[at] <= limit]
    return assessments[_take_simplest(equal, sizes, assessments, lack)]


def _take_simplest(
    places: Sequence[int],
    sizes: Sequence[float],
    assessments: Sequence[Comparable],
    lack: Mapping[int, float],
) -> int:
    """Return the linear one of models with as much evidence, or a static one, or the smallest.

    Of linear models of one size, a state space is preferred: its noise is identified with it.
    """

    def rank(at: int) -> tuple[bool, bool, float, bool, float, int]:
        model = assessments[at].model
        linear, static = is_linear(model), is_static(model)
        return not linear, not static, sizes[at], linear and isinstance(model, Model), lack[at], at

    return min(places, key=rank)


def _measure_lack(
    places: Sequence[int], sizes: Sequence[float], assessments: Sequence[Comparable], terms: int
) -> dict[int, float]:
    """Return the information criteria of some models, which have a bounded free run."""
    compared = [assessments[at] for at in places]
    closest = min(compared, key=lambda entry: entry.mean_square)
    noise = ErrorNoise.fit(closest.errors, closest.split.segments)
    lack = measure_lack(
        [entry.model for entry in compared],
        [sizes[at] for at in places],
        [noise.measure(entry.errors) for entry in compared],
        noise.samples,
        terms,
    )
    return dict(zip(places, lack.tolist(), strict=True))


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

    They lack Property 1 and have a smaller error than the reference, or they fail the physics checks and are
    smaller than the recommended model.
    """
    if found.reference is None:
        return ()
    best, size = assessments[found.reference - 1], sizes[found.rank - 1]

    def is_rival(reason: str, rank: int) -> bool:
        if reason == PROPERTY_1:
            return assessments[rank - 1].validation_error < best.validation_error
        return reason == CHECKS and sizes[rank - 1] < size

    rivals = (
        replace(each, ranks=tuple(rank for rank in each.ranks if is_rival(each.reason, rank)))
        for each in found.excluded
    )
    return tuple(each for each in rivals if each.ranks)


def describe_exclusion(exclusion: Exclusion, assessments: Sequence[Assessment]) -> str:
    """State what excludes some models, to be read after their names."""
    if exclusion.reason == PROPERTY_1:
        return "without Property 1"
    return _describe_divergence([assessments[rank - 1].physics for rank in exclusion.ranks])


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


def _describe_choice(
    found: Recommendation,
    sizes: Sequence[float],
    assessments: Sequence[Assessment],
    unit: str,
    accurate: bool,
) -> str:
    """State the criterion, the errors, and the excluded models that the criterion would prefer."""
    chosen, best = (assessments[rank - 1] for rank in (found.rank, found.reference or found.rank))
    error, least = (_write_error(entry.validation_error, unit) for entry in (chosen, best))
    criterion = "information criterion of the free run on all data"
    rivals = [
        f"{_write_models(each.ranks, assessments, unit)} {describe_exclusion(each, assessments)}"
        for each in list_rivals(found, sizes, assessments)
    ]
    end = f"; left out: {' and '.join(rivals)}" if rivals else ""
    if chosen is best or accurate:
        return f"most evidence ({criterion}), RMSE on the validation data {error}{end}"
    if is_linear(chosen.model) and any(not is_linear(each.model) for each in assessments):
        return (
            f"linear: no nonlinear model has decisively more evidence ({criterion}); RMSE on the validation "
            f"data {error}{end}"
        )
    return (
        f"smallest of the models whose evidence ({criterion}) does not differ decisively: RMSE on the "
        f"validation data {error}, {least} of the model with the most evidence{end}"
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
