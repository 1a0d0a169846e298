"""Change detection on sequences: rate of false alarms, invariance, power."""

import numpy as np
import pytest
import scipy

from islands.diagnosis.monitoring.change_detection import (
    compute_statistics,
    find_threshold,
)

TRAINING = 20


def draw(records: int, sequences: int, correlation: float = 0.0, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal((records, sequences))
    return scipy.signal.lfilter([np.sqrt(1 - correlation**2)], [1.0, -correlation], noise, axis=0)


def find_steps(values: np.ndarray, training: int) -> tuple[np.ndarray, np.ndarray]:
    return compute_statistics(values, np.zeros_like(values), training)


def count_alarms(values: np.ndarray, rate: float) -> int:
    """Return the number of sequences with an alarm at any record."""
    threshold, alarmed = find_threshold(rate), np.zeros(values.shape[1], dtype=bool)
    for count in range(TRAINING + 2, len(values) + 1):
        statistics, _ = find_steps(values[:count], TRAINING)
        alarmed |= np.abs(statistics) > threshold
    return int(alarmed.sum())


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6])
def test_false_alarms_are_at_most_as_frequent_as_wanted(correlation):
    rate, records, sequences = 2e-3, 120, 60
    expected = sequences * (1.0 - np.exp(-rate * (records - TRAINING)))
    limit = scipy.stats.binom.ppf(0.999, sequences, expected / sequences)
    assert count_alarms(draw(records, sequences, correlation), rate) <= limit


@pytest.mark.nightly
@pytest.mark.parametrize(("correlation", "factor"), [(0.0, 1.0), (0.3, 1.0), (0.6, 1.0), (0.8, 1.7)])
def test_a_month_of_hourly_records_has_the_wanted_number_of_false_alarms(correlation, factor):
    """Twenty records of training are few for a high correlation, which is then underestimated."""
    rate, sequences = 1 / 720 / 10, 1000
    limit = scipy.stats.binom.ppf(0.999, sequences, 1.0 - np.exp(-0.1 * factor))
    assert count_alarms(draw(TRAINING + 720, sequences, correlation, 1), rate) <= limit


@pytest.mark.parametrize(("size", "delay"), [(2.0, 16), (4.0, 6)])
def test_a_step_is_found_within_its_delay(size, delay):
    values = draw(80 + delay, 40)
    values[80:] += size
    statistics, starts = find_steps(values, TRAINING)
    assert np.mean(statistics > find_threshold(1 / 720 / 30)) > 0.85
    assert np.median(np.abs(starts - 80)) <= 1


def test_three_records_far_beyond_the_limit_are_a_change():
    values = draw(53, 40)
    values[50:] += 20.0
    statistics, starts = find_steps(values, TRAINING)
    assert np.all(statistics > find_threshold(1 / 720 / 30))
    assert set(starts) == {50}


def test_a_value_that_a_record_hardly_determines_is_no_change():
    values, errors = draw(60, 40), np.full((60, 40), 0.1)
    values[-4:] += 8.0
    certain = np.abs(compute_statistics(values, errors, TRAINING)[0])
    errors[-4:] = 8.0
    uncertain = np.abs(compute_statistics(values, errors, TRAINING)[0])
    assert np.all(certain > find_threshold(1e-4))
    assert np.all(uncertain < find_threshold(1e-4))
