import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.channel import channels
from islands.records.inspection.noise import measure_noise
from islands.records.inspection.quantisation import find_quantisation
from support.known_records import lag, measure, slow, white


def measure_output_noise(record):
    channel = channels(record)[-1]
    return measure_noise(channel, record, find_quantisation(channel))


@pytest.mark.parametrize("level", [0.002, 0.02, 0.2])
def test_level_is_found_within_20_percent(level):
    for seed in range(5):
        for u in (slow(3000, seed), np.sin(0.02 * np.arange(3000))):
            y = lag(u, 30.0) / lag(u, 30.0).std()
            fact = measure_output_noise(Dataset(u, y + level * white(3000, [seed, 7]), 1.0))
            assert fact.value == pytest.approx(level, rel=0.2)
            assert fact.interval[0] <= fact.value <= fact.interval[1]


def test_noise_below_the_quantisation_step_is_not_stated():
    u = slow(3000, 0)
    y = np.round(u / u.std() + 1e-4 * white(3000, 1), 2)
    fact = measure_output_noise(Dataset(u, y, 1.0))
    assert fact.value is None
    assert fact.finding == "noise_below_step"


def test_interval_contains_the_level_of_most_records():
    hits = 0
    for seed in range(20):
        u = slow(2000, seed)
        fact = measure_output_noise(measure(u, u, 0.05, seed))
        hits += fact.interval[0] <= 0.05 * u.std() <= fact.interval[1]
    assert hits >= 16
