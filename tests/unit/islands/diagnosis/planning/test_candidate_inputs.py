"""Candidate inputs of the next experiment: within what a record has shown, or beyond it."""

import numpy as np
import pytest

from islands.diagnosis.planning.candidate_inputs import find_excess, list_inputs_beyond, list_inputs_within
from islands.diagnosis.planning.planned_input import find_limits
from support.planned import DT, wave


@pytest.mark.parametrize("u", [3.0 + wave((0.25, 0.6)), np.repeat([0.0, 2.0, -1.0, 1.0], 100)])
def test_inputs_within_the_record_exceed_neither_its_range_nor_its_rate(u: np.ndarray) -> None:
    limits = find_limits(u, DT)
    within = list_inputs_within(u, DT, limits, "V")
    assert {each.description.split()[0] for each in within} >= {"triangle", "random", "multisine", "the"}
    for each in within:
        assert each.u.shape == u.shape
        assert limits.contains(each.u, DT), each.description
        assert find_excess(each.u, DT, limits) == pytest.approx((1.0, 1.0))


def test_inputs_beyond_the_record_state_the_excess() -> None:
    u = wave((0.25,))
    limits = find_limits(u, DT)
    excesses = {
        each.description: find_excess(each.u, DT, limits) for each in list_inputs_beyond(u, DT, limits, "V")
    }
    assert all(max(each) > 1.0 for each in excesses.values())
    assert excesses["the same input 4 times as fast"] == pytest.approx((1.0, 4.0), rel=0.01)
    assert excesses["the same input 2 times as large"] == pytest.approx((2.0, 2.0), rel=0.01)
