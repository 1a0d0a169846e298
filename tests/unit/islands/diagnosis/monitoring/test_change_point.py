"""Instant of a change: error, interval, and form."""

import numpy as np
import pytest

from islands.diagnosis.monitoring.change_point import ChangeForm, ChangePoint, locate_change

TRAINING, ONSET, RECORDS = 20, 60, 90


def draw(seed: int, step: float = 0.0, slope: float = 0.0) -> np.ndarray:
    values = np.random.default_rng(seed).standard_normal(RECORDS)
    after = np.maximum(np.arange(RECORDS) - ONSET + 1.0, 0.0)
    return 7.0 + 0.1 * (values + step * (after > 0) + slope * after)


def locate(values: np.ndarray, training: int) -> ChangePoint:
    return locate_change(values, np.zeros_like(values), training)


@pytest.mark.parametrize("step", [1.0, 2.0, 4.0])
def test_the_interval_contains_the_instant_of_a_step_in_95_percent(step):
    found = [locate(draw(seed, step), TRAINING) for seed in range(60)]
    assert sum(each.earliest <= ONSET <= each.latest for each in found) >= 52
    assert np.median([abs(each.record - ONSET) for each in found]) <= 4.0 / step**2


def test_a_drift_is_distinguished_from_a_step():
    assert locate(draw(0, slope=0.5), TRAINING).form == ChangeForm.RAMP
    assert locate(draw(0, step=4.0), TRAINING).form == ChangeForm.STEP
