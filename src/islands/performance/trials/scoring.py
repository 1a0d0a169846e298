"""The tally of blind trials: how often the analysis was right, with bounds, beside what it should be."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from islands.performance.trials.targets import EXACT, Targets
from islands.performance.trials.trial import TrialOutcome

#: Bounds of the bands of misfits, in standard deviations of the noise; names are counted from the second on.
FAINT, FROM, STRONG = 0.05, 0.2, 1.0

#: Equally wide bins of the confidence.
BINS = 10

#: What the bounds leave out, half of it on either side.
_OUTSIDE = 0.05


@dataclass(frozen=True, slots=True)
class Proportion:
    """How many of some trials came out in a way.

    Attributes
    ----------
    name : str
    count, of : int
    goal : float or None
        In percent.
    most : bool
        The goal is the most that is allowed; else it is the least.
    """

    name: str
    count: int
    of: int
    goal: float | None = None
    most: bool = False

    @property
    def percent(self) -> float:
        """The point estimate."""
        return 100 * self.count / self.of if self.of else float("nan")

    @property
    def bounds(self) -> tuple[float, float]:
        """Clopper and Pearson's 95 % interval, in percent."""
        low = betaincinv(self.count, self.of - self.count + 1, _OUTSIDE / 2) if self.count else 0.0
        high = (
            betaincinv(self.count + 1, self.of - self.count, 1 - _OUTSIDE / 2)
            if self.count < self.of
            else 1.0
        )
        return 100 * float(low), 100 * float(high)

    @property
    def kept(self) -> bool | None:
        """Whether the point estimate keeps the goal; None without trials or a goal."""
        return _kept(self.percent, self)


@dataclass(frozen=True, slots=True)
class Statistic:
    """A number of some trials.

    Attributes
    ----------
    name : str
    value : float
    of : int
    goal : float or None
    most : bool
        The goal is the most that is allowed; else it is the least.
    """

    name: str
    value: float
    of: int
    goal: float | None = None
    most: bool = False

    @property
    def kept(self) -> bool | None:
        """Whether it keeps the goal; None without trials or a goal."""
        return _kept(self.value, self)


def _kept(value: float, asked: Proportion | Statistic) -> bool | None:
    if asked.goal is None or not asked.of:
        return None
    return value <= asked.goal if asked.most else value >= asked.goal


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """Names that were said with about the same confidence: how sure the analysis was, and how often right."""

    low: float
    high: float
    count: int
    said: float
    right: float


def score(
    outcomes: Sequence[TrialOutcome], unknown: Sequence[str], goals: Targets = EXACT
) -> list[Proportion | Statistic]:
    """Count outcomes by what was hidden.

    That the form of an identified model is wrong is true of the model, on clean records as well: outcomes do
    not count it among their names, so here it is no false name, makes no set of names inexact, and detects
    nothing that was hidden.

    Parameters
    ----------
    outcomes : sequence of TrialOutcome
    unknown : sequence of str
        Names of causes that the simulation has no name for.
    goals : Targets
    """
    known = [each for each in outcomes if not set(each.trial.effects) & set(unknown)]
    clean = [each for each in known if not each.trial.effects]
    open_set = [each for each in outcomes if each not in known]
    every = [each for each in known if len(each.trial.effects) == 1]
    single = [each for each in every if each.misfit > FROM]
    pairs = [each for each in known if len(each.trial.effects) == 2]
    triples = [each for each in known if len(each.trial.effects) == 3]
    detected = [each for each in single if each.noticed]
    named = [each for each in detected if each.named]
    gains = [each.gain_share for each in detected if each.gain_share is not None]
    bins = reliability(known)

    def share(
        name: str,
        among: Sequence[TrialOutcome],
        right: Callable[[TrialOutcome], bool],
        goal: float | None,
        most: bool = False,
    ) -> Proportion:
        return Proportion(name, sum(map(right, among)), len(among), goal, most)

    def seen(name: str, low: float, high: float, goal: float | None) -> Proportion:
        among = [each for each in every if low < each.misfit <= high]
        return share(f"detected, misfit {name} sigma", among, lambda each: each.noticed, goal)

    return [
        seen(f"{FAINT:g} to {FROM:g}", FAINT, FROM, goals.weak),
        seen(f"{FROM:g} to {STRONG:g}", FROM, STRONG, goals.middle),
        seen(f"> {STRONG:g}", STRONG, float("inf"), goals.strong),
        share("named first, where detected", detected, lambda each: each.first_right, goals.first),
        share(
            "among the first three, where detected",
            detected,
            lambda each: bool({*each.named[:1], *each.candidates} & set(each.trial.effects)),
            goals.three,
        ),
        share("family, where detected", detected, lambda each: each.family_right, goals.family),
        share("truth within the reported set", detected, lambda each: each.within_set, goals.within),
        Statistic("names in the reported set, mean", _mean([each.set_size for each in named]), len(named)),
        share("false names on clean records", clean, lambda each: bool(each.named), goals.false_names, True),
        share("pairs exact", pairs, lambda each: each.exact, goals.pairs),
        share("triples exact", triples, lambda each: each.exact, goals.triples),
        Statistic("share of the oracle's gain, median", _quantile(gains, 0.5), len(gains), goals.gain),
        Statistic(
            "share of the oracle's gain, 10th percentile", _quantile(gains, 0.1), len(gains), goals.gain_tenth
        ),
        Statistic(
            "calibration error of the confidence",
            calibration_error(bins),
            sum(each.count for each in bins),
            goals.calibration,
            True,
        ),
        share(
            "unknown causes silently misnamed",
            open_set,
            lambda each: each.verdict == "named" and bool(each.named),
            goals.misnamed,
            True,
        ),
    ]


def reliability(outcomes: Sequence[TrialOutcome]) -> list[ReliabilityBin]:
    """Hold confidences against frequencies: first names in equally wide bins, those that hold any.

    A name on a clean record is a wrong one.
    """
    said = np.array([each.confidence for each in outcomes if each.named])
    right = np.array([each.first_right for each in outcomes if each.named])
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
    """Return how far confidences are from frequencies, on average over the names (Naeini et al., 2015)."""
    count = sum(each.count for each in bins)
    return sum(each.count * abs(each.said - each.right) for each in bins) / count if count else float("nan")


def confusion(outcomes: Sequence[TrialOutcome]) -> Mapping[tuple[str, str], int]:
    """Count what single hidden effects were called: (hidden, named first) to how often; "" is no name.

    What was noticed and got no name is called "unknown".
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
