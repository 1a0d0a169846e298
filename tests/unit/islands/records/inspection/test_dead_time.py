import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.dead_time import estimate_dead_times
from lab.inspection.dead_times import make_record as draw_record
from support.known_records import delay, lag, measure, slow, steps, white
from support.levels import nightly_but


def make_record(make_input, dead_time, noise=0.05, seed=0, samples=1500):
    u = make_input(samples, seed)
    return measure(u, delay(lag(u, 8.0), dead_time), noise, seed, dt=0.1)


def estimate(record):
    (fact,) = estimate_dead_times(record, [0])
    return fact


@pytest.mark.parametrize("make_input", [white, steps])
@pytest.mark.parametrize("dead_time", [0, 4, 15, 80])
@pytest.mark.parametrize("seed", nightly_but([0], range(3)))
def test_dead_time_is_found_within_one_sample(make_input, dead_time, seed):
    fact = estimate(make_record(make_input, dead_time, seed=seed))
    assert abs(fact.value - (dead_time + 1)) <= 1
    assert fact.interval[0] <= dead_time + 1 <= fact.interval[1]


@pytest.mark.ci
def test_stated_confidence_is_the_frequency_of_right_values():
    # Systems of third order begin so slowly that noise hides the first samples.
    right, confidences = [], []
    for seed in range(30):
        u = steps(1200, seed, 10)
        response = lag(lag(lag(u, 4.0), 5.0), 6.0)
        fact = estimate(measure(u, delay(response, 5), 0.05, seed))
        right.append(abs(fact.value - 8) <= 1)
        confidences.append(fact.confidence)
    assert np.mean(right) >= np.mean(confidences) - 0.15
    assert np.mean(confidences) > 0.5


def test_predictable_input_does_not_tell_the_dead_time():
    u = np.sin(0.05 * np.arange(2000))
    fact = estimate(measure(u, delay(lag(u, 8.0), 5), 0.02))
    assert (fact.value, fact.confidence) == (None, None)
    assert fact.interval[1] - fact.interval[0] > 30


@pytest.mark.parametrize("seed", range(3))
def test_a_slow_input_tells_the_dead_time_behind_a_slow_response(seed):
    """The cross-correlation has its peak 30 samples later."""
    u = slow(1200, seed)
    fact = estimate(measure(u, delay(lag(lag(u, 20.0), 10.0), 6), 0.05, seed))
    assert abs(fact.value - 8) <= 1


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(2))
def test_periodic_and_drifting_inputs_do_not_invent_dead_times(seed):
    """Dead times of 16 to 45 samples were stated for the sun and the outdoor temperature of a house."""
    day = 2.0 * np.pi * np.arange(1500) / 120.0
    outdoor = np.sin(day) + 0.02 * np.cumsum(white(1500, seed))
    sun = np.maximum(0.0, np.sin(day + 1.5)) * steps(1500, seed + 10, 120)
    heater = np.sign(steps(1500, seed + 20, 20))
    room = lag(heater, 9.0) + 0.5 * lag(lag(outdoor, 9.0), 40.0) + 0.5 * lag(sun, 9.0)
    room += 0.03 * white(1500, seed + 30)
    facts = estimate_dead_times(Dataset(np.column_stack([heater, outdoor, sun]), room, 720.0), range(3))
    assert all(
        fact.interval[0] <= first <= fact.interval[1] for fact, first in zip(facts, (1, 2, 1), strict=True)
    )
    assert all(fact.value is None or abs(fact.value - 1) <= 1 for fact in facts)


def test_every_input_has_its_own_dead_time():
    u, v = white(2000, 1), white(2000, 2)
    y = delay(lag(u, 5.0), 3) + delay(lag(v, 5.0), 9)
    record = Dataset(np.column_stack([u, v]), y + 0.05 * white(2000, 3), 1.0)
    assert [fact.value for fact in estimate_dead_times(record, (0, 1))] == [4, 10]


def test_a_lag_that_is_probably_wrong_is_stated_as_an_interval():
    """Ramps excite a slow response so little that a dead time and a time constant are equal."""
    levels = np.random.default_rng(0).normal(size=10)
    u = np.interp(np.arange(1200), np.arange(0, 1500, 150), levels)
    fact = estimate(measure(u, delay(lag(lag(u, 20.0), 10.0), 10), 0.05))
    assert fact.value is None
    assert fact.interval[0] <= 12 <= fact.interval[1]
    assert fact.finding == "dead_time_uncertain"


@pytest.mark.nightly
def test_stated_probability_is_the_share_of_right_values_for_slow_inputs():
    """The records of `lab/inspection/dead_times.py`, which has the table for 200."""
    stated = []
    for seed in range(40):
        record, lags = draw_record(1000 * (seed + 1))
        for fact, right in zip(estimate_dead_times(record, range(record.inputs)), lags, strict=True):
            if fact.value is not None:
                stated.append((fact.confidence, right is not None and abs(fact.value - right) <= 1.0))
    mean, share = np.mean(stated, axis=0)
    assert len(stated) > 50
    assert abs(mean - share) < 0.1
    assert np.mean([right for confidence, right in stated if confidence > 0.95]) > 0.85
