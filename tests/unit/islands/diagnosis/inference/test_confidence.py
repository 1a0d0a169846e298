"""Confidence of a cause among its alternatives."""

import numpy as np
import pytest

from islands.diagnosis.inference.confidence import (
    BLOCKS,
    ScoredAlternative,
    compute_confidence,
    make_unlisted_cause,
)
from lab.diagnosis.trial import Trial, run_trial

EVEN = np.full(BLOCKS, 10.0)


def test_blocks_that_contradict_each_other_lower_the_confidence() -> None:
    contradictory = EVEN + 30.0 * np.where(np.arange(BLOCKS) % 2, 1.0, -0.9)
    named = ScoredAlternative(80.0, EVEN)
    confidences = [
        compute_confidence(named, [ScoredAlternative(50.0, squares)])
        for squares in (EVEN + 30.0 / BLOCKS, contradictory)
    ]
    assert confidences[0] > 0.999
    assert 0.5 < confidences[1] < 0.9


def test_alternative_with_the_same_simulation_is_weighed_by_its_score() -> None:
    named, other = ScoredAlternative(60.0, EVEN), ScoredAlternative(56.0, None)
    assert compute_confidence(named, [other]) == pytest.approx(1.0 / (1.0 + np.exp(-1.0)))


def test_remainder_lowers_the_confidence_unless_it_is_small() -> None:
    named = ScoredAlternative(60.0, EVEN)
    remainders = (5e-7, 5e-4, 0.005, 0.3)
    confidences = [compute_confidence(named, [make_unlisted_cause(named, each)]) for each in remainders]
    assert confidences == pytest.approx([1.0 / (1.0 + odds) for odds in (1e-4, 0.1, 1.0, 1.0)])


@pytest.mark.nightly
def test_name_of_an_unlisted_cause_that_leaves_a_remainder_is_not_certain() -> None:
    found = run_trial(Trial(("power-law",), 6_700_002))
    assert (found.verdict, found.named[0]) == ("named with remainder", "dead-zone")
    assert found.confidence < 0.6


@pytest.mark.nightly
def test_unlisted_cause_of_a_recorded_output_is_discovered() -> None:
    found = run_trial(Trial(("cubic-damping",), 910005, core="column"))
    assert (found.verdict, found.named) == ("discovered", ("missing-term",))
