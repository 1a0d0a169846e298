from dataclasses import replace

import numpy as np

from islands.records.inspection.oversampling import recommend_rate
from support.known_records import lag, measure, white


def test_oversampled_record_can_be_averaged():
    u = np.sin(2.0 * np.pi * np.arange(20_000) / 2000.0)
    fact = recommend_rate(measure(u, lag(u, 50.0), 0.01, dt=0.001))
    assert fact.value == 0.05


def test_fast_record_keeps_its_rate():
    u = white(5000, 0)
    assert recommend_rate(measure(u, lag(u, 3.0), dt=0.1)).value == 0.1


def test_samples_that_are_far_apart_are_reported():
    u = white(2000, 0)
    assert recommend_rate(measure(u, u)).finding == "rate_low"


def test_a_record_of_single_samples_shows_no_rate():
    record = measure(white(100, 0), white(100, 1))
    single = replace(record, segments=(1,) * 100, recordings=("",) * 100)
    assert recommend_rate(single).finding == "rate_unconnected"
