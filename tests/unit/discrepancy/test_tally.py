"""The tally of trials: what is counted, and its bounds."""

import pytest

from islands.trials.tally import Share, confusion, tally
from islands.trials.trial import Outcome, Trial


def outcome(hidden: tuple[str, ...], named: tuple[str, ...], misfit: float = 1.0, **said: object) -> Outcome:
    verdict = said.pop("verdict", "named" if named else "nothing")
    sets = said.pop("equivalents", ((),) * len(named))
    return Outcome(Trial(hidden, 1), misfit, str(verdict), named, (), sets, named[:1], 0.9)  # type: ignore[arg-type]


def counted(*outcomes: Outcome) -> dict[str, tuple[int, int]]:
    return {share.name: (share.count, share.of) for share in tally(outcomes, ["ripple"])}


def test_everything_is_counted_where_it_belongs() -> None:
    found = counted(
        outcome(("delay",), ("delay",)),
        outcome(("delay",), ("jump",), equivalents=(("delay",),)),
        outcome(("jump",), ()),
        outcome(("jump",), (), misfit=0.1),
        outcome((), ()),
        outcome((), ("offset",)),
        outcome(("delay", "jump"), ("jump", "delay")),
        outcome(("delay", "jump"), ("jump",)),
        outcome(("ripple",), ("jump",)),
        outcome(("ripple",), (), verdict="unknown"),
    )
    assert found == {
        "detected, misfit > 0.2 sigma": (2, 3),
        "named first, where detected": (1, 2),
        "among the first three, where detected": (1, 2),
        "family, where detected": (1, 2),
        "truth within the reported set": (2, 2),
        "false names on clean records": (1, 2),
        "pairs exact": (1, 2),
        "triples exact": (0, 0),
        "unknown causes silently misnamed": (1, 2),
    }


def test_bounds_are_those_of_clopper_and_pearson() -> None:
    """0 of 300 allows 1.2 %, 97 of 100 stands for 91.5 to 99.4 %."""
    assert Share("", 0, 300).bounds == pytest.approx((0.0, 1.2221), abs=1e-3)
    assert Share("", 97, 100).bounds == pytest.approx((91.482, 99.377), abs=1e-2)
    assert Share("", 5, 5).bounds[1] == 100.0


@pytest.mark.parametrize(
    ("count", "goal", "most", "kept"),
    [(97, 97.0, False, True), (96, 97.0, False, False), (1, 1.0, True, True), (2, 1.0, True, False)],
)
def test_a_goal_is_kept_or_missed(count: int, goal: float, most: bool, kept: bool) -> None:
    assert Share("", count, 100, goal, most).kept is kept


def test_a_confusion_says_what_was_taken_for_what() -> None:
    found = confusion([outcome(("delay",), ("jump",)), outcome(("delay",), ("jump",)), outcome((), ())])
    assert found == {("delay", "jump"): 2, ("", ""): 1}
