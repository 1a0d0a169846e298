import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.impulse_response import estimate_impulse_response
from support.known_records import delay, lag, measure, white


@pytest.mark.parametrize("make_input", [white, lambda n, seed: lag(white(n, seed), 3.0)])
def test_response_of_a_lag_is_found_within_its_band(make_input):
    decay = np.exp(-1.0 / 8.0)
    truth = np.concatenate([np.zeros(6), (1.0 - decay) * decay ** np.arange(54)])
    for seed in range(3):
        u = make_input(6000, seed)
        found = estimate_impulse_response(measure(u, delay(lag(u, 8.0), 5), 0.05, seed), 0)
        assert np.mean(np.abs(found.values - truth) <= found.errors) >= 0.85
        assert np.argmax(found.values > 0.5 * found.values.max()) == 6


def test_no_response_stays_within_the_band():
    inside = []
    for seed in range(10):
        found = estimate_impulse_response(Dataset(white(2000, seed), white(2000, [seed, 1]), 1.0), 0)
        inside.append(np.mean(np.abs(found.values) <= found.errors))
    assert np.mean(inside) >= 0.93
