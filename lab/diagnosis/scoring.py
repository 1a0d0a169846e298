"""Scores of blind trials: rates with confidence intervals, compared with targets."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from lab.diagnosis.targets import EXACT, Targets
from lab.diagnosis.trial import TrialOutcome

#: Lower bound of the weak misfits, in standard deviations of the noise.
WEAK_MISFIT = 0.05

#: Lower bound of the middle misfits; smaller ones do not count in the scores of names.
MIDDLE_MISFIT = 0.2

#: Lower bound of the strong misfits.
STRONG_MISFIT = 1.0

#: Number of bins of the confidence, of equal width.
BINS = 10

#: Confidence above which a name is taken for certain.
SURE = 0.9

#: Probability outside the confidence interval, half of it on either side.
_OUTSIDE = 0.05


@dataclass(frozen=True, slots=True)
class Proportion:
    """Fraction of trials with a given result.

    Attributes
    ----------
    name : str
    count, of : int
        Number of trials with the result, and of all trials considered.
    goal : float or None
        Target in percent.
    most : bool
        Whether the target is an upper limit; otherwise it is a lower limit.
    """

    name: str
    count: int
    of: int
    goal: float | None = None
    most: bool = False

    @property
    def percent(self) -> float:
        """Point estimate in percent."""
        return 100 * self.count / self.of if self.of else float("nan")

    @property
    def bounds(self) -> tuple[float, float]:
        """Clopper-Pearson 95 % confidence interval in percent."""
        low = betaincinv(self.count, self.of - self.count + 1, _OUTSIDE / 2) if self.count else 0.0
        high = (
            betaincinv(self.count + 1, self.of - self.count, 1 - _OUTSIDE / 2)
            if self.count < self.of
            else 1.0
        )
        return 100 * float(low), 100 * float(high)

    @property
    def kept(self) -> bool | None:
        """Whether the point estimate meets the target; None without trials or a target."""
        return _meets_goal(self.percent, self)


@dataclass(frozen=True, slots=True)
class Statistic:
    """Statistic of a set of trials.

    Attributes
    ----------
    name : str
    value : float
    of : int
        Number of values.
    goal : float or None
        Target, in the unit of the value.
    most : bool
        Whether the target is an upper limit; otherwise it is a lower limit.
    """

    name: str
    value: float
    of: int
    goal: float | None = None
    most: bool = False

    @property
    def kept(self) -> bool | None:
        """Whether the value meets the target; None without trials or a target."""
        return _meets_goal(self.value, self)


def _meets_goal(value: float, row: Proportion | Statistic) -> bool | None:
    if row.goal is None or not row.of:
        return None
    return value <= row.goal if row.most else value >= row.goal


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """First names with a similar confidence.

    Attributes
    ----------
    low, high : float
        Bounds of the confidence.
    count : int
        Number of names.
    said : float
        Mean confidence.
    right : float
        Fraction of correct names.
    """

    low: float
    high: float
    count: int
    said: float
    right: float


def score(
    outcomes: Sequence[TrialOutcome], unknown: Sequence[str], goals: Targets = EXACT
) -> list[Proportion | Statistic]:
    """Score the outcomes of trials by the injected faults.

    A model-form error of an identified model is real, even on clean records. Outcomes do not list it among
    their names, so that it is neither a false name nor a detection and does not make a set of names inexact.

    Parameters
    ----------
    outcomes : sequence of TrialOutcome
    unknown : sequence of str
        Injected causes that the analysis has no name for.
    goals : Targets
    """
    causes = set(unknown)
    known = [each for each in outcomes if not causes & set(each.trial.effects)]
    single = [each for each in known if len(each.trial.effects) == 1]
    detected = [each for each in single if each.misfit > MIDDLE_MISFIT and each.noticed]
    bins = reliability(outcomes)
    return [
        *_score_detection(single, goals),
        *_score_names(detected, goals),
        *_score_sets(known, goals),
        *_score_gains(detected, goals),
        Statistic(
            "calibration error of the confidence",
            calibration_error(bins),
            sum(each.count for each in bins),
            goals.calibration,
            True,
        ),
        *_score_unknown_causes(
            [each for each in outcomes if causes & set(each.trial.effects)], causes, goals
        ),
    ]


def _count(
    name: str,
    among: Sequence[TrialOutcome],
    condition: Callable[[TrialOutcome], bool],
    goal: float | None = None,
    most: bool = False,
) -> Proportion:
    """Return the proportion of the trials that meet a condition."""
    return Proportion(name, sum(map(condition, among)), len(among), goal, most)


def _score_detection(single: Sequence[TrialOutcome], goals: Targets) -> list[Proportion]:
    """Return how many single faults are detected, by the size of their misfit."""
    bands = (
        (f"{WEAK_MISFIT:g} to {MIDDLE_MISFIT:g}", WEAK_MISFIT, MIDDLE_MISFIT, goals.weak),
        (f"{MIDDLE_MISFIT:g} to {STRONG_MISFIT:g}", MIDDLE_MISFIT, STRONG_MISFIT, goals.middle),
        (f"> {STRONG_MISFIT:g}", STRONG_MISFIT, float("inf"), goals.strong),
    )
    return [
        _count(
            f"detected, misfit {name} sigma",
            [each for each in single if low < each.misfit <= high],
            lambda each: each.noticed,
            goal,
        )
        for name, low, high, goal in bands
    ]


def _score_names(detected: Sequence[TrialOutcome], goals: Targets) -> list[Proportion | Statistic]:
    """Return how well detected single faults are named."""
    sizes = [each.set_size for each in detected if each.named]
    return [
        _count("named first, where detected", detected, lambda each: each.first_right, goals.first),
        _count(
            "among the first three, where detected",
            detected,
            lambda each: bool({*each.named[:1], *each.candidates} & set(each.trial.effects)),
            goals.three,
        ),
        _count("family, where detected", detected, lambda each: each.family_right, goals.family),
        _count("truth within the reported set", detected, lambda each: each.within_set, goals.within),
        Statistic("names in the reported set, mean", _mean(sizes), len(sizes)),
    ]


def _score_sets(known: Sequence[TrialOutcome], goals: Targets) -> list[Proportion]:
    """Return how well no fault, pairs and triples are named."""
    clean, pairs, triples = (
        [each for each in known if len(each.trial.effects) == count] for count in (0, 2, 3)
    )
    shares = [
        _count("false names on clean records", clean, lambda each: bool(each.named), goals.false_names, True)
    ]
    for name, sets, goal in (("pairs", pairs, goals.pairs), ("triples", triples, goals.triples)):
        identifiable = [each for each in sets if each.identifiable]
        shares += [
            _count(f"{name} exact", sets, lambda each: each.exact, goal),
            _count(f"{name} exact or equivalent", sets, lambda each: each.within_sets),
            _count(f"identifiable {name} exact or equivalent", identifiable, lambda each: each.within_sets),
        ]
    return shares


def _score_gains(detected: Sequence[TrialOutcome], goals: Targets) -> list[Statistic]:
    """Return how much of the gain of the injected faults the names reach."""
    gains = [each.gain_share for each in detected if each.gain_share is not None]
    return [
        Statistic("share of the oracle's gain, median", _quantile(gains, 0.5), len(gains), goals.gain),
        Statistic(
            "share of the oracle's gain, 10th percentile", _quantile(gains, 0.1), len(gains), goals.gain_tenth
        ),
    ]


def _score_unknown_causes(
    outcomes: Sequence[TrialOutcome], unknown: Set[str], goals: Targets
) -> list[Proportion]:
    """Return how often trials with causes that have no name get one."""
    alone = [each for each in outcomes if set(each.trial.effects) <= unknown]
    mixed = [each for each in outcomes if not set(each.trial.effects) <= unknown]

    def is_misnamed(each: TrialOutcome) -> bool:
        return each.verdict == "named" and bool(each.named)

    return [
        _count("unknown causes silently misnamed", alone, is_misnamed, goals.misnamed, True),
        _count(
            f"unknown causes misnamed with a confidence above {SURE:g}",
            alone,
            lambda each: is_misnamed(each) and each.confidence > SURE,
            goals.misnamed,
            True,
        ),
        _count("known cause named, next to an unknown one", mixed, lambda each: each.one_right),
        _count(
            "known cause and an equation or a family, next to an unknown one",
            mixed,
            lambda each: each.one_right and each.verdict in ("discovered", "family"),
        ),
        _count("wrong name next to an unknown cause", mixed, lambda each: bool(each.wrong), most=True),
    ]


def reliability(outcomes: Sequence[TrialOutcome]) -> list[ReliabilityBin]:
    """Compare confidences with the frequency of correct first names, in non-empty bins of equal width.

    A name on a clean record is wrong, and so is one of a cause that is not in the catalogue. Discovered terms
    and families are no names.
    """
    claims = [each for each in outcomes if each.named and each.verdict.startswith("named")]
    said = np.array([each.confidence for each in claims])
    right = np.array([each.first_right for each in claims])
    place = np.minimum((BINS * said).astype(int), BINS - 1)
    return [
        ReliabilityBin(
            each / BINS,
            (each + 1) / BINS,
            int(np.sum(place == each)),
            float(said[place == each].mean()),
            float(right[place == each].mean()),
        )
        for each in range(BINS)
        if (place == each).any()
    ]


def calibration_error(bins: Sequence[ReliabilityBin]) -> float:
    """Return the expected calibration error of the confidence (Naeini et al., 2015)."""
    count = sum(each.count for each in bins)
    return sum(each.count * abs(each.said - each.right) for each in bins) / count if count else float("nan")


def confusion(outcomes: Sequence[TrialOutcome]) -> Mapping[tuple[str, str], int]:
    """Return the confusion counts of single faults: (injected, named first) to the number of trials.

    "" means no fault or no name. A discrepancy that was detected but not named is "unknown".
    """
    return Counter(
        (
            each.trial.effects[0] if each.trial.effects else "",
            each.named[0] if each.named else "unknown" if each.noticed else "",
        )
        for each in outcomes
        if len(each.trial.effects) <= 1
    )


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _quantile(values: Sequence[float], share: float) -> float:
    return float(np.quantile(values, share)) if values else float("nan")
