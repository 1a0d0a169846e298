"""Whether the inputs of a record follow its output."""

import numpy as np
import pytest

from islands.records.dataset import Dataset
from islands.records.inspection.feedback import find_feedback
from support.known_records import hysteresis, lag, measure, slow, steps, white


def balance(samples=2000, seed=0, unstable=1.04):
    """A mass on a negative spring under a controller of position and speed with noise."""
    rng = np.random.default_rng(100 + seed)
    set_point, noise = steps(samples, seed), 0.02 * rng.standard_normal(samples)
    u, y, before = np.zeros(samples), np.zeros(samples), 0.0
    total, product = unstable + 1.0 / unstable, 1.0
    for k in range(2, samples):
        y[k] = total * y[k - 1] - product * y[k - 2] + 0.01 * (u[k - 1] + u[k - 2])
        seen = y[k] + noise[k]
        u[k] = set_point[k] - 1.5 * seen - 12.0 * (seen - before)
        before = seen
    return Dataset(u, y + noise, 0.001, ("u",), "y")


def control(samples=3000, seed=0, gain=0.5):
    """A lag with noise that is controlled with a delay of a sample; the gain is that of the controller."""
    rng = np.random.default_rng(100 + seed)
    set_point, u, y, x = white(samples, seed), np.zeros(samples), np.zeros(samples), 0.0
    for k in range(1, samples):
        x = 0.9 * x + 0.1 * u[k - 1]
        y[k] = x + 0.3 * rng.standard_normal()
        u[k] = set_point[k] - gain * y[k - 1]
    return Dataset(u, y, 1.0, ("u",), "y")


@pytest.mark.parametrize("seed", range(3))
def test_an_unstable_process_that_stays_bounded_is_in_a_closed_loop(seed):
    fact = find_feedback(balance(seed=seed))
    assert (fact.finding, fact.value) == ("feedback_unstable", True)
    assert fact.details["pole"] == pytest.approx(1.04, abs=0.01)
    assert "closed loop" in fact.sentence


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_output_in_later_inputs_is_feedback(seed):
    assert find_feedback(control(seed=seed)).finding == "feedback_visible"
    assert find_feedback(control(seed=seed, gain=0.0)).value is False


@pytest.mark.parametrize("noise", [0.0, 1e-6, 0.02])
@pytest.mark.parametrize("excite", [steps, slow, white])
def test_inputs_of_an_open_loop_do_not_follow_its_output(excite, noise):
    u = excite(1000, 1)
    for y in (lag(u, 5.0), lag(u, 100.0), hysteresis(u), np.cumsum(u - u.mean()), lag(u**2, 5.0)):
        assert find_feedback(measure(u, y, noise, 1)).value is False


def test_a_growing_response_of_an_open_loop_is_no_feedback():
    u = white(200, 0)
    y = np.zeros(200)
    for k in range(1, 200):
        y[k] = 1.03 * y[k - 1] + u[k - 1]
    assert find_feedback(measure(u, y, 1e-3, 0)).value is False


def test_short_records_do_not_tell():
    assert find_feedback(measure(white(12, 0), white(12, 1))).value is None
