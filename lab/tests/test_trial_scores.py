"""Scores of trials: counts, bounds and targets."""

import pytest

from lab.diagnosis.scoring import (
    Proportion,
    Statistic,
    calibration_error,
    reliability,
    score,
)
from lab.diagnosis.trial import Trial, TrialOutcome


def outcome(
    injected: tuple[str, ...], named: tuple[str, ...], misfit: float = 1.5, **options: object
) -> TrialOutcome:
    verdict = options.pop("verdict", "named" if named else "nothing")
    sets = options.pop("equivalents", ((),) * len(named))
    confidence, gain = options.pop("confidence", 0.9), options.pop("gain_share", None)
    least, form = options.pop("least_gain", None), options.pop("form", False)
    assert not options
    return TrialOutcome(
        Trial(injected, 1), misfit, str(verdict), named, (), sets, named[:1], confidence, gain, least, form
    )  # type: ignore[arg-type]


def counted(*outcomes: TrialOutcome) -> dict[str, tuple[int, int]]:
    rows = score(outcomes, ["ripple"])
    return {row.name: (row.count, row.of) for row in rows if isinstance(row, Proportion)}


def measured(*outcomes: TrialOutcome) -> dict[str, Statistic]:
    return {row.name: row for row in score(outcomes, ["ripple"]) if isinstance(row, Statistic)}


def test_every_outcome_is_counted_in_its_scores() -> None:
    found = counted(
        outcome(("delay",), ("delay",)),
        outcome(("delay",), ("jump",), equivalents=(("delay",),)),
        outcome(("jump",), ()),
        outcome(("jump",), (), misfit=0.5),
        outcome(("jump",), ("jump",), misfit=0.5),
        outcome(("jump",), (), misfit=0.1),
        outcome(("jump",), ("offset",), misfit=0.1),
        outcome(("jump",), (), misfit=0.01),
        outcome((), ()),
        outcome((), ("offset",)),
        outcome(("delay", "jump"), ("jump", "delay")),
        outcome(("delay", "jump"), ("jump",), least_gain=5.0),
        outcome(("delay", "jump"), ("jump", "sensor-lag"), equivalents=((), ("delay",)), least_gain=7.0),
        outcome(("delay", "jump"), ("jump", "sensor-lag"), equivalents=(("delay",), ())),
        outcome(("ripple",), ("jump",)),
        outcome(("ripple",), (), verdict="unknown"),
        outcome(("ripple", "jump"), ("jump",)),
    )
    assert found == {
        "detected, misfit 0.05 to 0.2 sigma": (1, 2),
        "detected, misfit 0.2 to 1 sigma": (1, 2),
        "detected, misfit > 1 sigma": (2, 3),
        "named first, where detected": (2, 3),
        "among the first three, where detected": (2, 3),
        "family, where detected": (2, 3),
        "truth within the reported set": (3, 3),
        "false names on clean records": (1, 2),
        "pairs exact": (1, 4),
        "pairs exact or equivalent": (2, 4),
        "identifiable pairs exact or equivalent": (2, 3),
        "triples exact": (0, 0),
        "triples exact or equivalent": (0, 0),
        "identifiable triples exact or equivalent": (0, 0),
        "unknown causes silently misnamed": (1, 2),
        "unknown causes misnamed with a confidence above 0.9": (0, 2),
        "known cause named, next to an unknown one": (1, 1),
        "known cause and an equation or a family, next to an unknown one": (0, 1),
        "wrong name next to an unknown cause": (0, 1),
    }


def test_confidences_are_compared_with_frequencies() -> None:
    """Three of four names with confidence 0.95 and one of two with 0.55 are right; false names are wrong."""
    outcomes = [
        *[outcome(("delay",), ("delay",), confidence=0.95)] * 3,
        outcome((), ("offset",), confidence=0.95),
        outcome(("delay",), ("delay",), confidence=0.55),
        outcome(("delay",), ("jump",), confidence=0.55),
        outcome(("delay",), (), verdict="unknown"),
        outcome(("ripple",), ("missing-term",), verdict="discovered", confidence=1.0),
        outcome(("ripple",), ("jump",), confidence=0.95),
    ]
    bins = reliability(outcomes[:-1])
    assert [(each.low, each.count, each.right) for each in bins] == [(0.5, 2, 0.5), (0.9, 4, 0.75)]
    assert [each.said for each in bins] == pytest.approx([0.55, 0.95])
    assert calibration_error(bins) == pytest.approx((2 * 0.05 + 4 * 0.2) / 6)
    row = measured(*outcomes)["calibration error of the confidence"]
    assert (row.value, row.of) == (pytest.approx((2 * 0.05 + 5 * 0.35) / 7), 7)
    misnamed = counted(*outcomes)["unknown causes misnamed with a confidence above 0.9"]
    assert misnamed == (1, 2)
    assert row.kept is False


def test_bounds_are_the_clopper_pearson_interval() -> None:
    """0 of 300 gives an upper bound of 1.2 %; 97 of 100 gives 91.5 to 99.4 %."""
    assert Proportion("", 0, 300).bounds == pytest.approx((0.0, 1.2221), abs=1e-3)
    assert Proportion("", 97, 100).bounds == pytest.approx((91.482, 99.377), abs=1e-2)
    assert Proportion("", 5, 5).bounds[1] == 100.0
