import numpy as np
import pytest

from islands.records.inspection.stamp_regularity import describe_stamps


def test_gap_repeated_and_backward_stamps_are_found():
    stamps = 0.1 * np.arange(100)
    stamps[50:] += 0.3
    stamps[70] = stamps[69]
    stamps[90:] -= 5.0
    found = describe_stamps(stamps)
    assert found.gaps == (50, 71)
    assert found.missing == 3 + 1
    assert found.repeated == (70,)
    assert found.backward == (90,)


def test_jitter_is_the_deviation_of_the_steps():
    steps = 0.1 * (1.0 + 0.05 * np.random.default_rng(0).uniform(-1.0, 1.0, 5000))
    found = describe_stamps(np.cumsum(steps))
    assert found.jitter == pytest.approx(0.05 / 3**0.5, rel=0.05)


def test_stamps_that_never_increase_have_no_rate():
    assert describe_stamps(np.zeros(10)) is None
    assert describe_stamps(-np.arange(10.0)) is None
