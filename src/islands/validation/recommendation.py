"""Choice of one model among the ranked models of a search, by their evidence.

Models whose evidence differs by less than `DECISIVE` are equal: a linear one comes first, then the smallest.
If the user prefers accuracy, the one with the most evidence comes first. See `islands.validation.evidence`.

The measured data are the evidence. The physics checks simulate inputs that the record does not contain, and a
system may diverge at them as its models do: a reaction that runs away, a spring that softens. The checks
therefore choose among models that the data do not distinguish. Property 1 is a requirement of the search.

The setting ``select`` can replace this rule by the paper's choice of Appendix A: the least training error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import TypeAlias
from weakref import WeakKeyDictionary

from islands.models.form import is_linear, is_static
from islands.models.narx import Model
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.evidence import DECISIVE, ErrorNoise, count_terms, measure_lack
from islands.validation.physics import PhysicsChecks

#: Reasons to exclude models, in the order of the criteria.
DIVERGENCE = "validation-divergence"
PROPERTY_1 = "property-1"
EVIDENCE = "evidence"
CHECKS = "physics-checks"

#: A model of one or several outputs with its errors.
Comparable: TypeAlias = Assessment | CoupledAssessment

#: Noise of the errors of a model, and their square with the last noise: a front is compared again whenever a
#: model is added to it.
_NOISES: WeakKeyDictionary[object, ErrorNoise] = WeakKeyDictionary()
_SQUARES: WeakKeyDictionary[object, tuple[ErrorNoise, float]] = WeakKeyDictionary()


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
        Reasons for the choice, each a statement about measured quantities; see `state_reasons`.
    reference : int or None
        Rank of the model that the others are compared with. None if models are not compared.
    excluded : tuple of Exclusion
        In the order of the criteria. The smallest of the models that none excludes is recommended.
    """

    rank: int
    reasons: tuple[str, ...] = ()
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


def recommend(assessments: Sequence[Assessment], hysteresis: bool, accurate: bool = False) -> Recommendation:
    """Choose the simplest of the models with the most evidence.

    Candidates are the models whose free run on the validation data is bounded and, if the search constrains
    models of hysteresis, of them those that have Property 1. The one with the most evidence is the reference.
    Of the models with as much evidence, those that diverge in holds or excursions are excluded, and the first
    linear one of the rest is recommended, or a static one, or the smallest. A criterion that no model meets
    excludes none.

    Parameters
    ----------
    assessments : sequence of Assessment
        Assessments on the same estimation data and validation data, best first.
    hysteresis : bool
        Whether models need Property 1.
    accurate : bool
        Whether the model with the most evidence is recommended, of those that are left.
    """
    bounded = [at for at, entry in enumerate(assessments) if entry.outcomes["validation"]["free_run"]]
    if not bounded:
        return Recommendation(1)
    selection = _Selection(len(assessments))
    selection.keep(DIVERGENCE, bounded)
    if hysteresis:
        selection.keep(PROPERTY_1, [at for at in bounded if assessments[at].physics.property_1])
    # A divergence that the record does not show needs a smaller error than that of every model without one.
    sound = [at for at in selection.left if is_sound(assessments[at].physics, hysteresis)]
    if sound:
        selection.keep(CHECKS, [at for at in selection.left if at in sound or at < sound[0]])
    terms = count_terms([entry.model for entry in assessments])
    lack = _measure_lack(selection.left, assessments, terms)
    reference = min(selection.left, key=lambda at: (lack[at], at))
    limit = lack[reference] + DECISIVE
    selection.keep(EVIDENCE, [at for at in selection.left if lack[at] <= limit])
    selection.keep(CHECKS, [at for at in selection.left if at in sound])
    chosen = (
        min(selection.left, key=lambda at: (lack[at], at))
        if accurate
        else _take_simplest(selection.left, assessments, lack)
    )
    return Recommendation(chosen + 1, (), reference + 1, tuple(selection.excluded))


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
    lack = _measure_lack(bounded, assessments, terms)
    limit = min(lack.values()) + DECISIVE
    equal = [at for at in bounded if lack[at] <= limit]
    return assessments[_take_simplest(equal, assessments, lack)]


def measure_squares(assessments: Sequence[Comparable]) -> tuple[list[float], int]:
    """Return the mean squares of the whitened errors of models, and the number of errors.

    The noise is that of the closest of them; see `ErrorNoise`.
    """
    noise = _fit_noise(min(assessments, key=lambda entry: entry.mean_square))
    return [_measure_square(noise, entry) for entry in assessments], noise.samples


def _fit_noise(closest: Comparable) -> ErrorNoise:
    key = _identify(closest)
    if key not in _NOISES:
        _NOISES[key] = ErrorNoise.fit(closest.errors, closest.split.segments)
    return _NOISES[key]


def _measure_square(noise: ErrorNoise, entry: Comparable) -> float:
    key = _identify(entry)
    known = _SQUARES.get(key)
    if known is None or known[0] is not noise:
        known = _SQUARES[key] = noise, noise.measure(entry.errors)
    return known[1]


def _identify(entry: Comparable) -> object:
    """Return an object that lives as long as the errors of a model."""
    return entry.all_data if isinstance(entry, Assessment) else entry


def _take_simplest(
    places: Sequence[int], assessments: Sequence[Comparable], lack: Mapping[int, float]
) -> int:
    """Return the linear one of models with as much evidence, or a static one, or the smallest.

    Of linear models, a state space is preferred: its order and its dead times are identified together with
    the noise, and from all samples, also those that a lag of an equation leaves out.
    """

    def rank(at: int) -> tuple[bool, bool, bool, float, float, int]:
        model, size = assessments[at].model, assessments[at].size
        linear, static = is_linear(model), is_static(model)
        return not linear, not static, linear and isinstance(model, Model), size, lack[at], at

    return min(places, key=rank)


def _measure_lack(places: Sequence[int], assessments: Sequence[Comparable], terms: int) -> dict[int, float]:
    """Return the information criteria of some models, which have a bounded free run."""
    compared = [assessments[at] for at in places]
    squares, samples = measure_squares(compared)
    models, sizes = [entry.model for entry in compared], [entry.size for entry in compared]
    lack = measure_lack(models, sizes, squares, samples, terms)
    return dict(zip(places, lack.tolist(), strict=True))


def recommend_fittest(assessments: Sequence[Assessment], mode: str) -> Recommendation:
    """Choose the model with the least error on the estimation data, as Appendix A of the paper does.

    The validation data have no influence: the free run of the model on them may diverge.

    Parameters
    ----------
    assessments : sequence of Assessment
        Assessments in the order of the ranks.
    mode : str
        An entry of ``MODES``: the simulation whose error the search minimised.
    """
    errors = [entry.metrics["estimation"][mode].rmse for entry in assessments]
    return Recommendation(
        1 + min(range(len(errors)), key=lambda at: (inf if isnan(errors[at]) else errors[at], at))
    )


def is_sound(physics: PhysicsChecks, hysteresis: bool) -> bool:
    """Return whether holds and excursions are bounded and, if required, Property 1 holds."""
    bounded = all(hold.bounded for hold in physics.holds) and all(
        excursion.bounded for excursion in physics.excursions
    )
    return bounded and (physics.property_1 or not hysteresis)
