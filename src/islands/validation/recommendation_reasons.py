"""Reasons for the recommendation of a model, as sentences about measured quantities."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from islands.models.form import is_linear, is_static
from islands.models.protocol import DynamicModel
from islands.validation.assessment import Assessment
from islands.validation.physics import EXCURSIONS, LEVELS, PhysicsChecks
from islands.validation.recommendation import (
    CHECKS,
    PROPERTY_1,
    Exclusion,
    Recommendation,
    is_sound,
)

#: Distance of the output at held inputs from its recorded range, in ranges, that is not stated.
_NEAR = 1.0

#: Drift of the output at the end of such a hold, in ranges, that is not stated.
_STILL = 0.01


def state_reasons(
    found: Recommendation,
    assessments: Sequence[Assessment],
    hysteresis: bool,
    unit: str = "",
    accurate: bool = False,
) -> tuple[str, ...]:
    """Return the reasons for a recommendation.

    Parameters
    ----------
    found : Recommendation
    assessments, hysteresis, accurate
        As for `recommend`.
    unit : str
        Unit of the output.
    """
    if found.reference is None:
        return ("the free run of every model diverges; this one has the least one-step-ahead error",)
    choice = (
        _describe_static(assessments[found.rank - 1].model),
        _describe_choice(found, assessments, unit, accurate),
    )
    reasons = "; ".join(filter(None, choice)), _describe_physics(found, assessments, hysteresis, unit)
    return tuple(filter(None, reasons))


def state_fit(entry: Assessment, mode: str, hysteresis: bool, unit: str = "") -> tuple[str, ...]:
    """Return the reasons for the model with the least error on the estimation data.

    Parameters
    ----------
    entry : Assessment
    mode : str
        As for `recommend_fittest`.
    hysteresis : bool
        Whether models need Property 1.
    unit : str
        Unit of the output.
    """
    size = _write_error(entry.metrics["estimation"][mode].rmse, unit)
    reason = f"least error of the search on the estimation data ({mode.replace('_', ' ')}), RMSE {size}"
    sound = is_sound(entry.physics, hysteresis)
    checks = _describe_passed(hysteresis, entry.final_physics) if sound else ""
    return tuple(filter(None, (reason, checks)))


def list_rivals(found: Recommendation, assessments: Sequence[Assessment]) -> tuple[Exclusion, ...]:
    """Return the excluded models that would be preferred without the reason that excludes them.

    They lack Property 1 and have a smaller error than the reference, or they fail the physics checks and are
    smaller than the recommended model.
    """
    if found.reference is None:
        return ()
    best, chosen = (assessments[rank - 1] for rank in (found.reference, found.rank))

    def is_rival(reason: str, rank: int) -> bool:
        if reason == PROPERTY_1:
            return assessments[rank - 1].validation_error < best.validation_error
        return reason == CHECKS and assessments[rank - 1].size < chosen.size

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


def _describe_static(model: DynamicModel) -> str:
    """State that a model is static; empty for another one."""
    if not is_static(model):
        return ""
    return f"static: {model.output_name} depends on the inputs of the same sample only"


def _describe_choice(
    found: Recommendation,
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
        for each in list_rivals(found, assessments)
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
