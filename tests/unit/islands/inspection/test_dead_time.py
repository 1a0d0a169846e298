import numpy as np
import pytest

from islands.data.dataset import Dataset, join
from islands.inspection.dead_time import estimate_dead_time
from support.known_records import delay, lag, measure, steps, white


def make_record(make_input, dead_time, noise=0.05, seed=0, samples=1500):
    u = make_input(samples, seed)
    return measure(u, delay(lag(u, 8.0), dead_time), noise, seed, dt=0.1)


@pytest.mark.parametrize("make_input", [white, steps])
@pytest.mark.parametrize("dead_time", [0, 4, 15, 80])
def test_dead_time_is_found_within_one_sample(make_input, dead_time):
    for seed in range(3):
        fact = estimate_dead_time(make_record(make_input, dead_time, seed=seed), 0)
        assert abs(fact.value - (dead_time + 1)) <= 1
        assert fact.interval[0] <= dead_time + 1 <= fact.interval[1]


def test_dead_time_of_a_clean_record_is_exact():
    for dead_time in (0, 3, 11):
        fact = estimate_dead_time(make_record(white, dead_time, noise=0.0), 0)
        assert fact.value == dead_time + 1
        assert fact.confidence > 0.9


@pytest.mark.ci
def test_stated_confidence_is_the_frequency_of_right_values():
    # Systems of third order begin so slowly that noise hides the first samples.
    right, confidences = [], []
    for seed in range(30):
        u = steps(1200, seed, 10)
        response = lag(lag(lag(u, 4.0), 5.0), 6.0)
        fact = estimate_dead_time(measure(u, delay(response, 5), 0.05, seed), 0)
        right.append(abs(fact.value - 8) <= 1)
        confidences.append(fact.confidence)
    assert np.mean(right) >= np.mean(confidences) - 0.15
    assert np.mean(confidences) < 0.9


def test_direct_response_has_no_dead_time():
    u = white(1000, 0)
    fact = estimate_dead_time(measure(u, u + lag(u, 5.0), 0.02), 0)
    assert fact.value == 0
    assert "within the sample" in fact.sentence


def test_predictable_input_does_not_tell_the_dead_time():
    u = np.sin(0.05 * np.arange(2000))
    fact = estimate_dead_time(measure(u, delay(lag(u, 8.0), 5), 0.02), 0)
    assert fact.value is None
    assert "predictable" in fact.sentence


def test_input_without_effect_has_no_visible_response():
    record = Dataset(white(1500, 0), white(1500, 1), 1.0)
    assert "visible" in estimate_dead_time(record, 0).sentence


def test_every_input_has_its_own_dead_time():
    u, v = white(2000, 1), white(2000, 2)
    y = delay(lag(u, 5.0), 3) + delay(lag(v, 5.0), 9)
    record = Dataset(np.column_stack([u, v]), y + 0.05 * white(2000, 3), 1.0)
    assert [estimate_dead_time(record, place).value for place in (0, 1)] == [4, 10]


def test_short_record_does_not_tell_the_dead_time():
    fact = estimate_dead_time(make_record(white, 2, samples=40), 0)
    assert fact.value is None
    assert "too short" in fact.sentence


def test_missing_outputs_are_left_out():
    whole = make_record(white, 4)
    y = whole.y.copy()
    y[300:320] = np.nan
    assert estimate_dead_time(Dataset(whole.u, y, whole.dt), 0).value == 5


def test_recordings_are_not_joined():
    parts = tuple(make_record(white, 4, seed=seed, samples=500) for seed in range(3))
    assert estimate_dead_time(join(parts), 0).value == 5


@pytest.mark.parametrize("part", [0.03, 0.07, 0.13, 0.19])
def test_means_of_a_held_input_do_not_shorten_the_dead_time(part):
    """Samples of a late column are between those of the input: a mean has a part of the next level."""
    for seed in range(3):
        u = steps(1500, seed, 10)
        y = delay(lag(u, 5.0), 3)
        means = (1.0 - part) * u + part * np.append(u[1:], u[-1])
        fact = estimate_dead_time(measure(means, y, 0.02, seed, dt=0.1), 0)
        assert fact.value == 4
        assert fact.interval[0] <= 4 <= fact.interval[1]
        assert fact.interval[0] < fact.interval[1]
        assert fact.confidence <= 0.99


def test_a_small_inverse_response_is_a_response():
    u = steps(1500, 0, 10)
    y = delay(lag(u, 5.0) - 1.2 * np.diff(lag(u, 1.0), prepend=0.0), 3)
    assert estimate_dead_time(measure(u, y, 0.005), 0).value == 4


def test_sentence_states_samples_seconds_and_range():
    fact = estimate_dead_time(make_record(white, 4), 0)
    assert "after 5 samples (0.5 s)" in fact.sentence
    low, high = fact.interval
    assert low < high
    assert f"between {low:.0f} and {high:.0f} samples with a probability of 95 %" in fact.sentence


def test_a_value_that_is_probably_wrong_is_not_stated_as_one():
    """The turning points of a slow sine tell little about a dead time."""
    u = np.sin(2 * np.pi * np.arange(2000) / 200) * np.repeat([1.0, 0.6, 0.9, 0.4], 500)
    fact = estimate_dead_time(measure(u, np.tanh(delay(lag(u, 20.0), 3)), 0.02), 0)
    assert fact.confidence < 0.5
    assert fact.sentence.startswith("It is uncertain when y responds to u")
