"""The tally of blind trials: how often the analysis was right, with bounds, beside what it should be."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import beta

from islands.trials.trial import Outcome

#: Misfit in standard deviations of the noise from which on an effect has to be found.
FROM = 0.2

#: What the bounds leave out, half of it on either side.
_OUTSIDE = 0.05


@dataclass(frozen=True, slots=True)
class Share:
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
        low = beta.ppf(_OUTSIDE / 2, self.count, self.of - self.count + 1) if self.count else 0.0
        high = (
            beta.ppf(1 - _OUTSIDE / 2, self.count + 1, self.of - self.count) if self.count < self.of else 1.0
        )
        return 100 * float(low), 100 * float(high)

    @property
    def kept(self) -> bool | None:
        """Whether the point estimate keeps the goal; None without trials or a goal."""
        if self.goal is None or not self.of:
            return None
        return self.percent <= self.goal if self.most else self.percent >= self.goal


def tally(outcomes: Sequence[Outcome], unknown: Sequence[str]) -> list[Share]:
    """Count outcomes by what was hidden.

    Parameters
    ----------
    outcomes : sequence of Outcome
    unknown : sequence of str
        Names of causes that the catalogue does not have.
    """
    clean = [each for each in outcomes if not each.trial.effects]
    open_set = [each for each in outcomes if set(each.trial.effects) & set(unknown)]
    single = [
        each
        for each in outcomes
        if len(each.trial.effects) == 1 and each not in open_set and each.misfit > FROM
    ]
    pairs = [each for each in outcomes if len(each.trial.effects) == 2]
    triples = [each for each in outcomes if len(each.trial.effects) == 3]
    detected = [each for each in single if each.noticed]

    def share(
        name: str, among: Sequence[Outcome], right: Callable[[Outcome], bool], goal: float, most: bool = False
    ) -> Share:
        return Share(name, sum(map(right, among)), len(among), goal, most)

    return [
        share(f"detected, misfit > {FROM:g} sigma", single, lambda each: each.noticed, 95.0),
        share("named first, where detected", detected, lambda each: each.first_right, 97.0),
        share(
            "among the first three, where detected",
            detected,
            lambda each: bool({*each.named[:1], *each.candidates} & set(each.trial.effects)),
            99.0,
        ),
        share("family, where detected", detected, lambda each: each.family_right, 99.0),
        share("truth within the reported set", detected, lambda each: each.within_set, 98.0),
        share("false names on clean records", clean, lambda each: bool(each.named), 1.0, most=True),
        share("pairs exact", pairs, lambda each: each.exact, 95.0),
        share("triples exact", triples, lambda each: each.exact, 80.0),
        share(
            "unknown causes silently misnamed",
            open_set,
            lambda each: each.verdict == "named" and bool(each.named),
            4.0,
            most=True,
        ),
    ]


def confusion(outcomes: Sequence[Outcome]) -> Mapping[tuple[str, str], int]:
    """Count what single hidden effects were called: (hidden, named first) to how often; "" is no name."""
    return Counter(
        (each.trial.effects[0] if each.trial.effects else "", each.named[0] if each.named else "")
        for each in outcomes
        if len(each.trial.effects) <= 1
    )
