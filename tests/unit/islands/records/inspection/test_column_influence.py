import numpy as np
import pytest

from islands.records.inspection.column_influence import average_middle, measure_influence
from support.known_records import lag, white


def test_the_past_of_the_cause_leads_and_not_that_of_the_effect():
    u = white(1500, 0)
    found = measure_influence(np.array([u, lag(u, 5.0) + 0.05 * white(1500, 1)]))
    assert found.leading[0, 1] > 0.5
    assert found.leading[1, 0] == 0.0
    assert np.all(found.visible >= found.leading)
    assert np.all(np.diag(found.visible) == 0.0)


def test_a_weak_cause_is_more_visible_if_the_strong_one_is_known():
    u, v = white(1000, 0), white(1000, 1)
    found = measure_influence(np.array([u, v, lag(u, 3.0) + 0.2 * lag(v, 3.0) + 0.01 * white(1000, 2)]))
    assert found.visible[1, 2] == 0.0
    assert found.measure_gain(2, [0], [1]) > 0.5
    assert found.visible[0, 2] > 0.5
    assert found.direct[0, 2] > 0.5


def test_the_response_to_one_step_is_visible_and_a_drift_is_none():
    u = np.repeat([0.0, 1.0], [100, 300])
    assert measure_influence(np.array([u, lag(u, 30.0) + 0.01 * white(400, 0)])).leading[0, 1] > 0.05
    assert not measure_influence(np.array([u, np.cumsum(white(400, 1))])).visible.any()


@pytest.mark.parametrize("scale", [1, 4])
def test_means_are_those_of_the_middle(scale):
    values = np.arange(20_000.0)[None]
    means = average_middle(values, scale)
    assert means.shape == (1, 4000)
    assert np.mean(means) == pytest.approx(np.mean(values))
    assert np.ptp(np.diff(means)) == 0.0
