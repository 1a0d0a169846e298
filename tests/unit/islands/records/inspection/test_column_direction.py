import numpy as np

from islands.records.inspection.column_direction import estimate_direction
from support.known_records import lag, steps, white


def make(noise=0.02):
    u = steps(1500, 0, 20)
    return np.array([u, lag(u, 10.0) + noise * white(1500, 1)])


def test_the_odds_favour_the_input():
    logits = estimate_direction(make()).logits
    assert logits[0, 1] > 3.0
    assert logits[1, 0] < -3.0


def test_the_odds_do_not_depend_on_the_units():
    signals = make()
    scaled = signals * np.array([[2.0**10], [2.0**-20]])
    assert np.allclose(estimate_direction(scaled).logits, estimate_direction(signals).logits, atol=1e-6)


def test_a_set_point_is_none_of_the_inputs_of_its_loop():
    rng = np.random.default_rng(0)
    set_point = steps(1500, 0, 80)
    u, y, x, total = np.zeros(1500), np.zeros(1500), 0.0, 0.0
    for k in range(1500):
        y[k] = x + 0.01 * rng.standard_normal()
        total += 0.05 * (set_point[k] - y[k])
        u[k] = 2.0 * (set_point[k] - y[k]) + total
        x = 0.95 * x + 0.05 * u[k]
    found = estimate_direction(np.array([set_point, u, y]))
    assert found.manipulated[1, 2] == 1.0
    assert found.manipulated[0, 2] == -1.0
    assert found.logits[1, 2] > found.logits[0, 2]
