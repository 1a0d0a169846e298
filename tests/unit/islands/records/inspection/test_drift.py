import numpy as np
import pytest

from islands.records.inspection.drift import measure_drift
from support.known_records import lag, measure, slow, steps


def test_drift_is_found_with_its_size():
    for seed in range(5):
        u = slow(4000, seed)
        y = lag(u, 10.0) / lag(u, 10.0).std()
        fact = measure_drift(measure(u, y + np.linspace(-0.5, 0.5, 4000), 0.02, seed))
        assert fact.value == pytest.approx(1.0, abs=0.25)
        assert fact.interval[0] <= 1.0 <= fact.interval[1]
        assert fact.finding == "drift_visible"


def test_record_without_drift_shows_none():
    for seed in range(10):
        u = steps(4000, seed)
        assert measure_drift(measure(u, lag(u, 10.0), 0.02, seed)).finding == "drift_none"


def test_trend_of_the_input_is_not_drift():
    u = np.linspace(0.0, 1.0, 4000) + 0.3 * slow(4000, 0)
    assert measure_drift(measure(u, lag(u, 5.0), 0.02)).finding == "drift_none"
