"""Progress of a diagnosis: honest about the time left over recorded runs, in every phase."""

import pytest

from islands.diagnosis.procedure import PHASES
from support.recorded_runs import find_quarters, find_standstills, late, replay

#: Recorded runs with the largest error of the time left beyond half of it, in seconds, as measured.
EXCESS = {
    "diagnosis-linear": 1.0,
    "diagnosis-second-order": 1.0,
    "diagnosis-short": 1.5,
    "diagnosis-explained": 1.0,
    "diagnosis-inside": 2.5,
    "diagnosis-known": 2.5,
}


@pytest.mark.parametrize("name", EXCESS)
def test_time_left_is_within_half_of_the_truth_and_some_seconds(name):
    shown = [each for each in late(replay(name)) if each.left is not None]
    assert len(shown) > 30
    assert all(abs(each.left - each.truth) <= 0.5 * each.truth + EXCESS[name] for each in shown)


@pytest.mark.parametrize("name", EXCESS)
def test_time_left_is_never_a_small_part_of_a_long_one(name):
    shown = [each for each in late(replay(name)) if each.left is not None and each.truth > 15.0]
    assert all(each.left >= 0.4 * each.truth for each in shown)


@pytest.mark.parametrize("name", EXCESS)
def test_bar_moves_in_every_quarter_and_never_back(name):
    moments = replay(name)
    fractions = [each.fraction for each in moments]
    assert fractions == sorted(fractions)
    quarters = find_quarters(moments)
    assert 0.0 < quarters[0] < quarters[1] < quarters[2] < quarters[3] <= 1.0


@pytest.mark.parametrize("name", EXCESS)
def test_time_left_is_never_constant_while_time_passes(name):
    assert not find_standstills(replay(name))


def test_shares_of_the_phases_are_those_of_the_whole():
    assert sum(phase.share for phase in PHASES if not phase.unless) == pytest.approx(1.0, abs=0.02)
